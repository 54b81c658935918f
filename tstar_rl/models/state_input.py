"""What networks see of an observation."""

import torch
from torch import Tensor, nn

from tstar_rl.models.normalizer import Normalizer
from tstar_rl.models.relative_features import RelativeFeatures

__all__ = ["StateInput"]


class StateInput(nn.Module):
    """An observation normalised, and beside it the features if there are any. It has no trained parameters.

    Args:
        obs_dim: numbers in an observation.
        normalizer: None passes observations through.
        features: of one subtask.
    """

    def __init__(
        self,
        obs_dim: int,
        normalizer: Normalizer | None = None,
        features: RelativeFeatures | None = None,
    ) -> None:
        super().__init__()
        self.normalizer = normalizer if normalizer is not None else nn.Identity()
        self.features = features
        self.out_dim = obs_dim + (features.out_dim if features is not None else 0)

    def forward(self, obs: Tensor) -> Tensor:
        """obs: (..., obs_dim) -> (..., out_dim)."""
        x = self.normalizer(obs)
        return x if self.features is None else torch.cat((x, self.features(obs)), -1)
