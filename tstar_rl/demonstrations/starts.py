"""States of demonstrations as the starts of episodes."""

import torch
from tensordict import TensorDictBase

from tstar_rl.demonstrations.data_set import Demonstrations

__all__ = ["DemonstrationStarts"]


class DemonstrationStarts:
    """Draws states of demonstrations, uniformly over all their steps, with replacement.

    An episode that begins there goes on from what the demonstration had done: its phase, its step count and its time
    limit. So a policy sees the later phases before it can reach them.

    Args:
        demonstrations: whose snapshots are drawn.

    Source: Peng et al. 2018, DeepMimic, "reference state initialization"; Nair et al. 2018, "resets".
    """

    def __init__(self, demonstrations: Demonstrations) -> None:
        self.snapshots = demonstrations.snapshots

    def sample(self, n: int, generator: torch.Generator) -> TensorDictBase:
        """n snapshots, batch size [n]."""
        rows = torch.randint(self.snapshots.batch_size[0], (n,), generator=generator)
        return self.snapshots[rows]
