"""What the tests of the transforms put into them: a network and a set of starts that are plain to see through."""

import torch
from tensordict import TensorDict
from torch import nn


class Slot(nn.Module):
    """Scores an observation by one of its numbers."""

    def __init__(self, index: int = 0) -> None:
        super().__init__()
        self.index = index

    def forward(self, obs):
        return obs[..., self.index : self.index + 1]


class FixedStarts:
    """Starts at a position of 0.9."""

    def __init__(self, available: bool = True) -> None:
        self.available = available

    def sample(self, n, generator):
        n = n if self.available else 0
        physics = torch.zeros(n, 4, dtype=torch.float64)
        physics[:, 0] = 0.9
        task = TensorDict({"steps": torch.zeros(n, dtype=torch.int64)}, [n])
        welds = torch.zeros(n, 2, 11, dtype=torch.float64)
        return TensorDict({"physics": physics, "welds": welds, "task": task}, [n])
