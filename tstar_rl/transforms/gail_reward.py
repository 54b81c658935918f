"""The reward of resembling an expert."""

from tensordict import TensorDictBase
from torch import Tensor, nn

from tstar_rl.equations import gail_reward
from tstar_rl.models.blocks import in_blocks
from tstar_rl.transforms.reward_transform import RewardTransform


class GAILReward(RewardTransform):
    """("next", "reward_gail"): `equations.gail_reward` of f_phi's score of a state. Only reads f_phi.

    Args:
        f_phi: (..., O) -> (..., 1), raw.
        state: "current" scores s ("observation": the paper's r(s_t)), "next" scores s'.

    Raises:
        ValueError: if `state` is neither.

    Source: the paper, eq. 1.
    """

    def __init__(self, f_phi: nn.Module, state: str = "current") -> None:
        if state not in ("current", "next"):
            raise ValueError(f"state must be 'current' or 'next', got {state!r}")
        super().__init__("reward_gail")
        self.f_phi = f_phi
        self.state = state

    def reward(self, current: TensorDictBase, following: TensorDictBase) -> Tensor:
        """(*batch, 1), in [0, 1]."""
        scored = current if self.state == "current" else following
        return gail_reward(in_blocks(self.f_phi, self.read(scored, "observation")))
