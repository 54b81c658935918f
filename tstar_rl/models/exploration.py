"""The deviation of a policy's actions over a run, where it follows a schedule."""

import math
from dataclasses import dataclass

from torch import nn

from tstar_rl.checks import InvalidValueError
from tstar_rl.models.networks import set_action_std

__all__ = ["Exploration"]


@dataclass(frozen=True)
class Exploration:
    """Deviations at the start and at the end of a run, linear in between; for a policy with std="fixed"."""

    arm: tuple[float, float]
    """Of the actions that move the arm."""
    hand: tuple[float, float]
    """Of the others, the gripper's and connect."""

    def __post_init__(self) -> None:
        for name in ("arm", "hand"):
            if not all(0 < value < math.inf for value in getattr(self, name)):
                raise InvalidValueError(
                    f"Exploration.{name} must be positive deviations, got {getattr(self, name)}"
                )

    def apply(self, policy: nn.Module, progress: float, actions: tuple[int, int] = (7, 2)) -> None:
        """Sets the deviation of a policy at `progress` in [0, 1]; `actions` as in `Skill`."""
        arm, hand = (first + progress * (last - first) for first, last in (self.arm, self.hand))
        set_action_std(policy, [arm] * actions[0] + [hand] * actions[1])
