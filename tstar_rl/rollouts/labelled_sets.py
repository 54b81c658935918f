"""Sets of states with labels: where a skill began and what came of it, and the states on the way there.

Both keep failures: a network that is to tell where a skill can start must see from where it could not.
"""

import torch
from tensordict import TensorDict
from torch import Tensor

from tstar_rl.checks import InvalidValueError
from tstar_rl.rollouts.labels import LABELS, Label
from tstar_rl.rollouts.state_sets import StateSet
from tstar_rl.signal_equations import proximity_target

__all__ = ["ApproachSet", "OutcomeSet"]


class OutcomeSet(StateSet):
    """Starts of a skill, those from which it failed too. Rows: "observation", "success", "share" (both in [0, 1]).

    Source: ours, near the data set of Chen et al. 2023 (Sequential Dexterity).
    """

    def add(self, starts: Tensor, succeeded: Tensor, share: Tensor) -> int:
        """Adds starts (n, O) with what came of them, (n,) each; returns n.

        Args:
            starts: observations in which the skill began.
            succeeded: whether it then succeeded.
            share: of the skills from this one to the chain's last, those that were then completed.

        Raises:
            InvalidValueError: if there is not one of each for each start.
        """
        _check_one_each(starts, succeeded=succeeded, share=share)
        rows = {"observation": starts, "success": succeeded.float(), "share": share.float()}
        return self.extend(TensorDict(rows, [len(starts)]))

    def labels(self, label: Label) -> Tensor:
        """What came of every start.

        (n,), in the order of `observations`; like these a view of the storage, so clone what is to stay.

        Raises:
            InvalidValueError: for a label that is not one of `LABELS`.
        """
        if label not in LABELS:
            raise InvalidValueError(f"label must be one of {', '.join(LABELS)}; got {label!r}")
        return self.buffer[:][label] if len(self) else torch.zeros(0, device=self.device)


class ApproachSet(StateSet):
    """States on the way to a start of a skill. Rows: "observation", "steps_left", "handed_over"."""

    def add(self, states: Tensor, steps_left: Tensor, handed_over: Tensor) -> int:
        """Adds states (n, O); returns n.

        Args:
            states: observations in an episode of the skill before.
            steps_left: (n,), from each to the episode's end.
            handed_over: (n,) bool, whether that end was one from which this skill succeeded.

        Raises:
            InvalidValueError: if there is not one of each for each state.
        """
        _check_one_each(states, steps_left=steps_left, handed_over=handed_over)
        rows = {"observation": states, "steps_left": steps_left, "handed_over": handed_over}
        return self.extend(TensorDict(rows, [len(states)]))

    def proximities(self, decay: float) -> Tensor:
        """How near every state was to a good start, (n,) in [0, 1]; see `signal_equations.proximity_target`."""
        if not len(self):
            return torch.zeros(0, device=self.device)
        rows = self.buffer[:]
        return proximity_target(rows["steps_left"], rows["handed_over"], decay)


def _check_one_each(states: Tensor, **labels: Tensor) -> None:
    for name, label in labels.items():
        if label.shape != states.shape[:1]:
            raise InvalidValueError(
                f"{name} must have a number for each of the {len(states)} states, (n,); got {tuple(label.shape)}"
            )
