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
)


def derive_seed(seed: int, purpose: str, *index: int | None) -> int:
    """A seed for a purpose and index of a run: what trains and what chooses never sees what is reported.

    Purposes have seeds of their own. Within one, the same index is the same seed, whatever it counts and whichever
    system asks: turn i of a chain trains with the seed that subtask i was trained with. An index of None, the whole
    task, is 99; an index that is left out is 0.
    """
    if purpose not in PURPOSES:
        raise ValueError(f"purpose must be one of {', '.join(PURPOSES)}; got {purpose!r}")
    words = np.random.SeedSequence(
        [seed, PURPOSES.index(purpose), *(99 if i is None else i for i in index)]
    ).generate_state(1)
    return int(words[0]) % 2**31
