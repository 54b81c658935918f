"""The one place that knows how the rewards are weighed."""

import math

from tensordict import TensorDictBase
from torch import Tensor

from tstar_rl.equations import mixed_reward
from tstar_rl.transforms.reward_transform import RewardTransform


class RewardMixture(RewardTransform):
    """("next", "reward"): reward_scale (lambda_1 r_env + lambda_2 r_gail + lambda_3 r_tsr), each r times its scale.

    Rewards of weight zero are not read, so they need not be there. The paper does not say whether its reward scale
    applies to all three terms. With the scales at 1 it does. The code released with it scales the environment's reward
    alone, and adds the terminal reward to that before lambda_1: gail_scale=20, tsr_scale=0.5.

    Args:
        lambda_1: weight of ("next", "reward_env").
        lambda_2: weight of ("next", "reward_gail").
        lambda_3: weight of ("next", "reward_tsr").
        reward_scale: multiplies the sum.
        env_scale: multiplies r_env, so that a departure from the paper does not hide in a lambda; so do
        gail_scale: (r_gail) and
        tsr_scale: (r_tsr).

    Raises:
        ValueError: if a number is not finite, or every weight is zero.

    Source: the paper, eq. 1 and 3; reward scale from its Table 2.
    """

    def __init__(
        self,
        lambda_1: float = 0.5,
        lambda_2: float = 0.5,
        lambda_3: float = 0.0,
        reward_scale: float = 0.05,
        env_scale: float = 1.0,
        gail_scale: float = 1.0,
        tsr_scale: float = 1.0,
    ) -> None:
        super().__init__("reward")
        self.lambdas = (lambda_1, lambda_2, lambda_3)
        self.scales = (env_scale, gail_scale, tsr_scale)
        self.reward_scale = reward_scale
        numbers = (*self.lambdas, *self.scales, reward_scale)
        if not all(math.isfinite(number) for number in numbers):
            raise ValueError(f"weights and scales must be finite, got {numbers}")
        if not any(self.effective_weights().values()):
            raise ValueError(
                "every weight of the mixture is zero: the policy would have nothing to learn from"
            )

    def effective_weights(self) -> dict[str, float]:
        """What one unit of each reward adds to the reward that the policy sees."""
        names = ("reward_env", "reward_gail", "reward_tsr")
        return {
            name: self.reward_scale * weight * scale
            for name, weight, scale in zip(names, self.lambdas, self.scales, strict=True)
        }

    def reward(self, current: TensorDictBase, following: TensorDictBase) -> Tensor:
        """(*batch, 1)."""
        weights = self.effective_weights()
        read = {name: self.read(following, name) for name, weight in weights.items() if weight}
        nothing = next(iter(read.values())).new_zeros(())
        r_env, r_gail, r_tsr = (read.get(name, nothing) for name in weights)
        return mixed_reward(r_env, r_gail, r_tsr, *weights.values())

    def __repr__(self) -> str:
        terms = " + ".join(
            f"{weight:g} {name}" for name, weight in self.effective_weights().items() if weight
        )
        return f"RewardMixture(reward = {terms})"
