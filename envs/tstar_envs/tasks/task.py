"""The verbs of a batched task, as in dm_control's `control.Task` but with a leading axis of N simulations."""

from __future__ import annotations

from typing import Protocol

from tensordict import TensorDict
from torch import Tensor


class BatchedTask(Protocol):
    """A task over N simulations. What changes during an episode is the TensorDict `state`, never an attribute."""

    def initialize_episode(self, state: TensorDict, mask: Tensor) -> None:
        """Starts new episodes in the simulations of `mask`, (N,) bool."""
        ...

    def before_step(self, state: TensorDict, action: Tensor) -> None:
        """Writes controls from actions (N, A) in [-1, 1]."""
        ...

    def after_step(self, state: TensorDict, action: Tensor, failed: Tensor) -> None:
        """Reads what the step did: events, rewards and ends are then in `state`."""
        ...

    def get_observation(self, state: TensorDict) -> Tensor:
        """Observation, (N, D) float64."""
        ...

    def get_reward(self, state: TensorDict) -> Tensor:
        """Reward of the last step, (N,) float64."""
        ...

    def get_termination(self, state: TensorDict) -> tuple[Tensor, Tensor]:
        """(terminated, truncated) of the last step, (N,) bool each."""
        ...
