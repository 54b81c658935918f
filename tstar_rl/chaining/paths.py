"""The last states of a skill's episodes, and how far each is from the end."""

from typing import NamedTuple

import torch
from torch import Tensor

__all__ = ["Path", "PathLog"]


class Path(NamedTuple):
    """The last states of some episodes, one after another.

    Attributes:
        states: (m, O), observations.
        steps_left: (m,) int64, steps from each state to the end of its episode; 0 in the last state.
        simulation: (m,) int64, in which the episode was.
    """

    states: Tensor
    steps_left: Tensor
    simulation: Tensor


class PathLog:
    """Remembers the last states of an episode in each of N simulations.

    Args:
        num_envs: N.
        length: states that are kept of an episode; 0: nothing is remembered.
    """

    def __init__(self, num_envs: int, length: int) -> None:
        self.length, self.ring = length, torch.zeros(num_envs, 0, 0)
        self.count = torch.zeros(num_envs, dtype=torch.int64)

    def add(self, observations: Tensor, running: Tensor) -> None:
        """Simulations `running` (N,) are where observations (N, O) say."""
        if not self.length:
            return
        if not self.ring.numel():
            self.ring = observations.new_zeros(len(observations), self.length, observations.shape[-1])
            self.count = self.count.to(observations.device)
        rows = running.nonzero().squeeze(-1)
        self.ring[rows, self.count[rows] % self.length] = observations[rows]
        self.count[rows] += 1

    def of(self, rows: Tensor) -> Path:
        """The states of the episodes in simulations `rows` (r,), once they are over."""
        if not self.length or not len(rows):
            return Path(self.ring.new_zeros(0, self.ring.shape[-1]), rows[:0], rows[:0])
        back = torch.arange(self.length, device=rows.device)
        there = back < self.count[rows].unsqueeze(-1)
        places = (self.count[rows].unsqueeze(-1) - 1 - back) % self.length
        states = self.ring[rows.unsqueeze(-1), places]  # (r, length, O)
        left, simulation = back.expand_as(there), rows.unsqueeze(-1).expand_as(there)
        return Path(states[there], left[there], simulation[there])
