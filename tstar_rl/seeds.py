"""Seeds: what trains, what chooses and what reports never share one."""

import numpy as np

__all__ = ["PURPOSES", "derive_seed"]

PURPOSES = (
    "train",
    "validate",
    "harvest",
    "evaluate",
    "demonstrate",
    "networks",
    "updates",
    "chain",
    "export",
    "collect",
)


def derive_seed(seed: int, purpose: str, *index: int | None) -> int:
    """A seed for a purpose and index of a run: what trains and what chooses never sees what is reported.

    Each purpose has seeds of its own. Within a purpose, the same index gives the same seed in every recipe. An index of
    None (the whole task) counts as 99; an index that is left out counts as 0.
    """
    if purpose not in PURPOSES:
        raise ValueError(f"purpose must be one of {', '.join(PURPOSES)}; got {purpose!r}")
    words = np.random.SeedSequence(
        [seed, PURPOSES.index(purpose), *(99 if i is None else i for i in index)]
    ).generate_state(1)
    return int(words[0]) % 2**31
