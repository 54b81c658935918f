"""The one place that knows how the rewards are weighed."""

import math
from collections.abc import Mapping

from tensordict import TensorDictBase
from torch import Tensor
from torchrl.envs import Compose

from tstar_rl.checks import InvalidValueError
from tstar_rl.equations import weighted_reward
from tstar_rl.transforms.reward_transform import RewardTransform

__all__ = ["RewardMixture", "weighted"]

PAPER_TERMS = ("env", "gail", "tsr")
"""Every config has weights of these, also where a recipe does not make all of them."""


class RewardMixture(RewardTransform):
    """("next", "reward"): reward_scale times the sum over terms of weight times scale times ("next", "reward_<term>").

    The paper's terms are env, gail and tsr; their weights are lambda_1, lambda_2 and lambda_3. Any other transform that
    writes "reward_<term>" is a term too. Terms of weight zero are not read, so they need not be there.

    The paper does not say whether its reward scale applies to all three terms. With the scales at 1 it does. The code
    released with it scales the environment's reward alone, and adds the terminal reward to that before lambda_1:
    scales={gail: 20, tsr: 0.5}.

    Args:
        weights: of each term.
        reward_scale: multiplies the sum.
        scales: of terms, 1 where none is given, so that a departure from the paper does not hide in a lambda.

    Raises:
        InvalidValueError: if a number is not finite, every weight is zero, or a scale is of a term that has no weight.

    Source: the paper, eq. 1 and 3; reward scale from its Table 2.
    """

    def __init__(
        self,
        weights: dict[str, float] | None = None,
        reward_scale: float = 0.05,
        scales: dict[str, float] | None = None,
    ) -> None:
        super().__init__("reward")
        for name, given in (("weights", weights), ("scales", scales)):
            if given is not None and not _has_numbers(given):
                raise InvalidValueError(
                    f"reward.{name} must have a number for each term, as {{'env': 0.5}}; got {given!r}"
                )
        self.weights = {"env": 0.5, "gail": 0.5} if weights is None else dict(weights)
        self.scales, self.reward_scale = dict(scales or {}), reward_scale
        unknown = [term for term in self.scales if term not in self.weights]
        if unknown:
            raise InvalidValueError(
                f"reward.scales has {', '.join(unknown)}, which reward.weights has not; "
                f"it has {', '.join(self.weights)}"
            )
        numbers = (*self.weights.values(), *self.scales.values(), reward_scale)
        if not all(math.isfinite(number) for number in numbers):
            raise InvalidValueError(f"reward.weights, scales and reward_scale must be finite, got {numbers}")
        if not any(self.effective_weights().values()):
            raise InvalidValueError(
                f"every weight of the mixture (reward.weights) is zero: the policy would have nothing to learn from; "
                f"got {self.weights}, scales {self.scales} and reward_scale {reward_scale}"
            )

    def effective_weights(self) -> dict[str, float]:
        """What one unit of each reward adds to the reward that the policy sees, by the reward's name."""
        return {
            f"reward_{term}": self.reward_scale * weight * self.scales.get(term, 1.0)
            for term, weight in self.weights.items()
        }

    def reward(self, current: TensorDictBase, following: TensorDictBase) -> Tensor:
        """(*batch, 1)."""
        weights = {name: weight for name, weight in self.effective_weights().items() if weight}
        return weighted_reward([self.read(following, name) for name in weights], list(weights.values()))

    def __repr__(self) -> str:
        terms = " + ".join(
            f"{weight:g} {name}" for name, weight in self.effective_weights().items() if weight
        )
        return f"RewardMixture(reward = {terms})"


def _has_numbers(given: object) -> bool:
    return isinstance(given, Mapping) and all(
        isinstance(number, (int, float)) and not isinstance(number, bool) for number in given.values()
    )


def weighted(mixture: RewardMixture, terms: Mapping[str, RewardTransform | None]) -> Compose:
    """The transforms of some terms, and the mixture of these terms and the environment's reward.

    Args:
        mixture: its weights of terms that are not there (the terminal reward of the last skill) do not count.
        terms: each writes ("next", "reward_<its name>"); one that is None is not there.

    Raises:
        InvalidValueError: if a term has no weight, or a term that is none of the paper's has one and is not made.
    """
    unpaid = [
        term for term, weight in mixture.weights.items() if weight and term not in {*PAPER_TERMS, *terms}
    ]
    if unpaid:
        raise InvalidValueError(
            f"reward.weights has {', '.join(unpaid)}, and this recipe makes no such reward; "
            f"it makes env, {', '.join(terms)}"
        )
    there = {term: transform for term, transform in terms.items() if transform is not None}
    for term in there:
        if term not in mixture.weights:
            raise InvalidValueError(
                f"reward.weights has no {term}; it has {', '.join(mixture.weights)}: give it a weight there"
            )
    kept = {term: weight for term, weight in mixture.weights.items() if term == "env" or term in there}
    scales = {term: scale for term, scale in mixture.scales.items() if term in kept}
    return Compose(*there.values(), RewardMixture(kept, mixture.reward_scale, scales))
