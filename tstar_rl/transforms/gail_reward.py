"""The reward of resembling an expert."""

from tensordict import TensorDictBase
from torch import Tensor, nn

from tstar_rl.equations import gail_reward
from tstar_rl.models.blocks import in_blocks
from tstar_rl.transforms.reward_transform import RewardTransform


class GAILReward(RewardTransform):
    """("next", "reward_gail"): `equations.gail_reward` of f_phi's score of s, the "observation". Only reads f_phi.

    Args:
        f_phi: (..., O) -> (..., 1), raw.

    Source: the paper, eq. 1.
    """

    def __init__(self, f_phi: nn.Module) -> None:
        super().__init__("reward_gail")
        self.f_phi = f_phi

    def reward(self, current: TensorDictBase, following: TensorDictBase) -> Tensor:
        """(*batch, 1), in [0, 1]."""
        return gail_reward(in_blocks(self.f_phi, self.read(current, "observation")))
