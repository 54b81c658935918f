"""The terminal reward with something else than d_omega to say how good the state is that the next skill is handed."""

import math

import torch
from torch import Tensor, nn

from tstar_rl.checks import InvalidValueError
from tstar_rl.signal_equations import feasibility, hand_over_value
from tstar_rl.transforms.terminal_state_reward import TerminalStateReward


class FeasibilityReward(TerminalStateReward):
    """("next", "reward_tsr"): F, the next skill's chance from where this one succeeded; 0 on other steps.

    Args:
        classifier: of the *next* skill's outcomes, (..., O) -> (..., 1), raw. Only read.
        **options: `score`, `baseline` and `momentum` of `TerminalStateReward`.

    Raises:
        InvalidValueError: for what `turn.once_learned` gives, whose 0 before it has learned is a chance of .5.

    Source: `signal_equations.feasibility`.
    """

    def __init__(self, classifier: nn.Module, **options: str | float) -> None:
        if hasattr(classifier, "has_learned"):
            raise InvalidValueError(
                "a classifier's raw 0 is a chance of .5, so turn.once_learned(...) would be paid before it has "
                "learned: give turn.following.network(...), and the reward once its update has_learned, as "
                "recipes/feasibility.py does"
            )
        super().__init__(classifier, **options)  # pyright: ignore[reportArgumentType]

    def said(self, obs: Tensor) -> Tensor:
        """F of states obs (n, O): (n, 1), in (0, 1)."""
        return feasibility(self.network(obs))


class HandOverValueReward(TerminalStateReward):
    """("next", "reward_tsr"): the next skill's value of where this one succeeded, as far as its critic is sure of it.

    A transform sees (s, s') alone, and the critic's error at s' shows only once the next skill has made a step from
    there. So the error is what a second network has learned from the next skill's own first steps.

    Args:
        value: of the *next* skill, (..., O) -> (..., 1), in the critic's own units. Only read.
        error: (..., O) -> (..., 1), the critic's squared temporal difference error in units of `scale`; None: it is not
            known yet, and the critic is trusted.
        alpha: see `signal_equations.hand_over_value`.
        scale: the value that counts as 1, in the critic's own units.
        **options: `score`, `baseline` and `momentum` of `TerminalStateReward`.

    Raises:
        ValueError: if alpha is negative or the scale is not positive, or one is not finite.

    Source: `signal_equations.hand_over_value`.
    """

    def __init__(
        self, value: nn.Module, error: nn.Module | None, alpha: float, scale: float, **options: str | float
    ) -> None:
        if not 0 <= alpha < math.inf or not 0 < scale < math.inf:
            raise ValueError(
                f"alpha must not be negative and scale positive, both finite; got {alpha} and {scale}"
            )
        super().__init__(value, **options)  # pyright: ignore[reportArgumentType]
        self.error, self.alpha, self.scale = error, alpha, scale

    def said(self, obs: Tensor) -> Tensor:
        """The weighed value of states obs (n, O): (n, 1), in [0, 1]."""
        value = self.network(obs) / self.scale
        squared_error = torch.zeros_like(value) if self.error is None else self.error(obs)
        return hand_over_value(value, squared_error, self.alpha)
