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
    """Remembers the last states of the episode that each of N simulations is in.

    Args:
        num_envs: N.
        skills: how many there are.
        length: states that are kept of an episode; 0: nothing is remembered.
    """

    def __init__(self, num_envs: int, skills: int, length: int) -> None:
        self.length, self.ring = length, torch.zeros(num_envs, 0, 0)
        self.count = torch.zeros(num_envs, dtype=torch.int64)
        self.ended: list[list[Path]] = [[] for _ in range(skills)]

    def begin(self, observations: Tensor, rows: Tensor) -> None:
        """A skill begins in simulations `rows` (r,), where observations (N, O) say."""
        if not self.length:
            return
        if not self.ring.numel():
            self.ring = observations.new_zeros(len(observations), self.length, observations.shape[-1])
            self.count = self.count.to(observations.device)
        self.count[rows] = 0
        self.add(observations, rows)

    def add(self, observations: Tensor, rows: Tensor) -> None:
        """Simulations `rows` (r,), or a mask (N,), have made a step and are where observations (N, O) say."""
        if not self.length:
            return
        rows = rows.nonzero().squeeze(-1) if rows.dtype == torch.bool else rows
        self.ring[rows, self.count[rows] % self.length] = observations[rows]
        self.count[rows] += 1

    def end(self, skill: int, rows: Tensor) -> None:
        """The episodes of a skill in simulations `rows` (r,) are over."""
        if not self.length or not len(rows):
            return
        back = torch.arange(self.length, device=rows.device)
        there = back < self.count[rows].unsqueeze(-1)
        places = (self.count[rows].unsqueeze(-1) - 1 - back) % self.length
        states = self.ring[rows.unsqueeze(-1), places]  # (r, length, O)
        left, simulation = back.expand_as(there), rows.unsqueeze(-1).expand_as(there)
        self.ended[skill].append(Path(states[there], left[there], simulation[there]))

    def of_skill(self, skill: int) -> Path:
        """The states of all episodes of a skill that are over."""
        pieces = self.ended[skill]
        if not pieces:
            none = self.count[:0]
            return Path(self.ring.new_zeros(0, self.ring.shape[-1]), none, none)
        return Path(*(torch.cat(parts) for parts in zip(*pieces, strict=True)))
