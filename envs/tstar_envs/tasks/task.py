"""The verbs of a batched task, as in dm_control's `control.Task` but with a leading axis of N simulations."""

from __future__ import annotations

from typing import Protocol

from torch import Tensor

EpisodeState = dict[str, Tensor]
"""What changes during an episode, (N, ...) each. The verbs replace its tensors and never write into them, so that
`dict(state)` is a copy. Not a TensorDict: that takes 13% of the time of a step of one simulation to read and write."""


class BatchedTask(Protocol):
    """A task over N simulations. What changes during an episode is in `state`, never an attribute."""

    def initialize_episode(self, state: EpisodeState, mask: Tensor) -> None:
        """Starts new episodes in the simulations of `mask`, (N,) bool."""
        ...

    def before_step(self, state: EpisodeState, action: Tensor) -> None:
        """Writes controls from actions (N, A) in [-1, 1]."""
        ...

    def after_step(self, state: EpisodeState, action: Tensor, failed: Tensor) -> None:
        """Reads what the step did: events, rewards and ends are then in `state`."""
        ...

    def get_observation(self, state: EpisodeState) -> Tensor:
        """Observation, (N, D) float64."""
        ...

    def get_reward(self, state: EpisodeState) -> Tensor:
        """Reward of the last step, (N,) float64."""
        ...

    def get_termination(self, state: EpisodeState) -> tuple[Tensor, Tensor]:
        """(terminated, truncated) of the last step, (N,) bool each."""
        ...
