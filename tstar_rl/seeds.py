"""Seeds: what trains, what chooses and what reports never share one."""

from numbers import Integral

import numpy as np

__all__ = ["EVALUATIONS", "PURPOSES", "derive_seed", "evaluation_seed"]

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

EVALUATIONS = (
    "deterministic",
    "stochastic",
    "hand_over",
    "own_starts",
    "chain",
    "influence",
    "exchange",
    "ways_home",
    "moved_parts",
    "latents",
    "parity",
)
"""What is evaluated, each with seeds of its own: the modes of `rollouts.episodes`, then what single recipes measure."""


def derive_seed(seed: int, purpose: str, *index: int | None) -> int:
    """A seed for a purpose and index of a run: what trains and what chooses never sees what is reported.

    Each purpose has seeds of its own. Within a purpose, the same index gives the same seed in every recipe. An index of
    None (the whole task) counts as 99. An index that is left out counts as 0, as long as there are two of them at most.

    Raises:
        ValueError: if there is no purpose of that name, or the seed or an index is no whole number from 0 to 2**32 - 1:
            a larger one would share its seeds with others of smaller ones.
    """
    if purpose not in PURPOSES:
        raise ValueError(f"purpose must be one of {', '.join(PURPOSES)}; got {purpose!r}")
    numbers = [99 if i is None else i for i in index]
    for name, value in (("seed", seed), *(("an index", number) for number in numbers)):
        if not isinstance(value, Integral) or not 0 <= value < 2**32:
            raise ValueError(f"{name} must be a whole number from 0 to 2**32 - 1, got {value}")
    words = np.random.SeedSequence([seed, PURPOSES.index(purpose), *numbers]).generate_state(1)
    return int(words[0]) % 2**31


def evaluation_seed(seed: int, what: str, *index: int | None) -> int:
    """`derive_seed` for one of `EVALUATIONS`: two that are reported side by side have no episode in common.

    Raises:
        ValueError: if there is no evaluation of that name.
    """
    if what not in EVALUATIONS:
        raise ValueError(f"an evaluation is one of {', '.join(EVALUATIONS)}; got {what!r}")
    return derive_seed(seed, "evaluate", EVALUATIONS.index(what), *index)
