"""What an episode is outside of this library: every step with its full state, and how two episodes differ."""

from dataclasses import dataclass, replace
from typing import Any

from tensordict import TensorDictBase
from torch import Tensor

__all__ = ["Episode", "Recording", "episode_differences"]


@dataclass(frozen=True)
class Episode:
    """One episode of T steps.

    Attributes:
        observations: (T + 1, O) float32, before the first action and after each.
        actions: (T, 9) float32 in [-1, 1], what the environment was given.
        rewards: (T,) float32, of the environment, not scaled.
        terminated: (T,) bool, the episode ended by success or failure.
        truncated: (T,) bool, the episode ran out of steps.
        success: (T,) bool, the step made the last connection there was to make.
        states: batch [T + 1], snapshots like the observations.
        labels: (T, 9) float32 in [-1, 1], what an expert would have done; None where nobody was asked.
        seed: of the environment that drew the start.
    """

    observations: Tensor
    actions: Tensor
    rewards: Tensor
    terminated: Tensor
    truncated: Tensor
    success: Tensor
    states: TensorDictBase
    labels: Tensor | None = None
    seed: int = 0

    def __len__(self) -> int:
        """T."""
        return len(self.actions)

    @property
    def succeeded(self) -> bool:
        """Whether the episode ended in success."""
        return bool(self.success[-1])


@dataclass(frozen=True)
class Recording:
    """Episodes of one environment.

    Attributes:
        arguments: of `FurnitureEnv`, plain values: task, subtask and settings.
        made_by: what acted, for people to read.
        episodes: in the order of their start.
        noise: deviation of the arm's executed actions, where an expert demonstrated; None where nothing is said.
        furniture: the digest of the task's file of furniture then (`env.task_tables.furniture_digest`); None likewise.
    """

    arguments: dict[str, Any]
    made_by: str
    episodes: list[Episode]
    noise: float | None = None
    furniture: str | None = None

    @property
    def successes(self) -> "Recording":
        """The same without the episodes that failed."""
        return replace(self, episodes=[episode for episode in self.episodes if episode.succeeded])


def episode_differences(first: Episode, second: Episode) -> list[str]:
    """In words, what the simulator did otherwise in the second episode; empty if both are the same to the bit."""
    found = []
    for name in ("observations", "actions", "rewards", "terminated", "truncated", "success"):
        found += _difference(name, getattr(first, name), getattr(second, name))
    states, others = (episode.states.flatten_keys("/") for episode in (first, second))
    for name, value in states.items():
        found += _difference(f"states/{name}", value, others[name])
    return found


def _difference(name: str, one: Tensor, other: Tensor) -> list[str]:
    if one.shape != other.shape:
        return [f"{name} has shape {tuple(one.shape)} and {tuple(other.shape)}"]
    unequal = (one != other).reshape(len(one), -1).any(-1)
    if not unequal.any():
        return []
    largest = float((one.double() - other.double()).abs().max())
    return [f"{name} differs from step {int(unequal.int().argmax())} on, by {largest:.2g} at most"]
