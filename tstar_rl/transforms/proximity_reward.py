"""A dense reward for coming nearer to a good hand-over."""

from tensordict import TensorDictBase
from torch import Tensor, nn

from tstar_rl.models.blocks import in_blocks
from tstar_rl.signal_equations import proximity_reward
from tstar_rl.transforms.reward_transform import RewardTransform


class ProximityReward(RewardTransform):
    """("next", "reward_proximity"): P(s') - P(s) at every step, plus P(s') where the skill succeeds. Only reads P.

    Args:
        proximity: P, how near a state is to a good start of the next skill, (..., O) -> (..., 1), raw.

    Source: `signal_equations.proximity_reward`.
    """

    def __init__(self, proximity: nn.Module) -> None:
        super().__init__("reward_proximity")
        self.proximity = proximity

    def reward(self, current: TensorDictBase, following: TensorDictBase) -> Tensor:
        """(*batch, 1), in [-1, 2]."""
        before, after = (
            in_blocks(self.proximity, self.read(state, "observation")) for state in (current, following)
        )
        return proximity_reward(before, after, self.read(following, "success"))

    def said(self, obs: Tensor) -> Tensor:
        """P of states obs (n, O): (n, 1), in [0, 1]."""
        return self.proximity(obs).clamp(0.0, 1.0)
