"""The values that the turns of a chain read.

This imports no torch, so that the config's section, which has these values and more, is checked before TorchRL loads.
"""

from dataclasses import dataclass
from typing import Literal, get_args

from tstar_rl.checks import check_choices, check_ranges

__all__ = ["ChainSettings", "Order"]

Order = Literal["forward", "backward", "costliest"]


@dataclass(frozen=True)
class ChainSettings:
    """How a chain is fine-tuned. docs/notation.md says which values are the paper's."""

    rounds: int
    """Times that every skill has its turn; with order=costliest, turns over the number of skills."""
    seed_episodes: int
    """Of the chain as it is, before the first turn, whose states fill the sets; 0: the sets begin empty."""
    kept_states: Literal["all", "chained"]
    """Which terminal states join beta_i; see `Turn.chained`."""
    d_omega_of: Literal["next", "own"]
    """Whose d_omega a turn of skill i trains: that of skill i + 1, which pays the turn, or that of skill i."""
    carry_over: bool
    """Whether optimisers and simulations of a skill go on from its last turn, or each turn makes new ones."""
    order: Order
    """Of the turns, see `TurnOrder`."""
    path_steps: int
    """How many of the last states of a skill's episodes a trial keeps, for signals along the way; 0: none."""
    logged_skill: int
    """Whose terminal states are logged, for the paper's Figure 4."""
    logged_states: int
    """How many of a rollout."""

    def __post_init__(self) -> None:
        check_choices(self, order=get_args(Order), kept_states=("all", "chained"), d_omega_of=("next", "own"))
        numbers = ("seed_episodes", "path_steps", "logged_skill", "logged_states")
        check_ranges(self, count=("rounds",), count_from_0=numbers)
