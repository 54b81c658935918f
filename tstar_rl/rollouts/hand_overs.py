"""What the skills of a chain hand to each other: the state at each seam, and whether the next skill then succeeded."""

from typing import NamedTuple

import torch
from tensordict import TensorDictBase
from torch import Tensor

__all__ = ["HandOver", "HandOvers"]


class HandOver(NamedTuple):
    """The states in which one skill of a chain ended and the next began."""

    subtask: int
    """Of the skill that begins here, 1 to K - 1."""
    observations: Tensor
    """(n, O), of the episodes that came so far, in the order of their simulations."""
    succeeded: Tensor
    """(n,) bool, whether the skill that begins here did its subtask."""


class HandOvers:
    """Remembers the states in which subtasks were done, to be called with every step of `run_episodes` of a whole task.

    One that is done in the step that ends the episode is handed to nobody.

    `chaining.trials.run_trial` tells the same skill after skill, each from a snapshot of where the one before ended.
    This is of a chain that runs from end to end, as it is evaluated, with nothing restored on the way. The published
    tables of `hand_over_gap.py` are of such episodes, to the last digit: so both stay, and a test holds them together.

    Args:
        links: skills of the chain.

    Raises:
        ValueError: if there are fewer than two.
    """

    def __init__(self, links: int) -> None:
        if links < 2:
            raise ValueError(f"hand-overs need a chain of at least two skills, got {links}")
        self.links = links
        self._completed: Tensor | None = None
        self._states: list[Tensor] = []
        self._came: list[Tensor] = []

    def __call__(self, tensordict: TensorDictBase) -> None:
        """Takes the step's TensorDict, batch [N]."""
        before, after = (each["completed"].squeeze(-1) for each in (tensordict, tensordict["next"]))
        found, ended = tensordict["next", "observation"], tensordict["next", "done"].squeeze(-1)
        if self._completed is None:
            self._completed = torch.zeros_like(after)
            self._states = [torch.zeros_like(found) for _ in range(self.links - 1)]
            self._came = [torch.zeros_like(ended) for _ in range(self.links - 1)]
        for done, (states, came) in enumerate(zip(self._states, self._came, strict=True), start=1):
            rows = (before < done) & (after >= done) & ~ended
            states[rows] = found[rows]
            came |= rows
        self._completed = torch.maximum(self._completed, after)

    def seams(self) -> list[HandOver]:
        """One for each pair of neighbouring skills, in order; a seam that no episode reached has no states.

        Raises:
            ValueError: if no step was taken.
        """
        if self._completed is None:
            raise ValueError("no step was taken yet: give this to run_episodes as each_step")
        found = []
        for subtask, (states, came) in enumerate(zip(self._states, self._came, strict=True), start=1):
            found.append(HandOver(subtask, states[came], self._completed[came] > subtask))
        return found
