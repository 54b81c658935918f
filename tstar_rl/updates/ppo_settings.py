"""How proximal policy optimisation is done."""

import math
from dataclasses import dataclass

from tstar_rl.checks import check_choices, check_ranges

__all__ = ["PPOSettings"]

COMPILE_MODES = ("default", "reduce-overhead", "max-autotune", "max-autotune-no-cudagraphs")
"""Of `torch.compile`."""


@dataclass(frozen=True)
class PPOSettings:
    """Source: the paper's appendix for the defaults; what it does not name is off, but for `max_grad_norm`.

    Raises:
        InvalidValueError: for a number out of its range, or an unknown mode of `compile`.
    """

    epochs: int = 10
    """Times that each rollout is gone through."""
    minibatch: int = 128
    """Rows at most: a rollout is split into nearly equal parts."""
    learning_rate: float = 3e-4
    """Of the actor."""
    critic_learning_rate: float | None = None
    """None: the actor's."""
    linear_decay: bool = True
    """Rates fall in a line, by the progress after a rollout: with n updates the first one has the share 1 - 1 / n, and
    the last one a rate of 0, so that it changes nothing."""
    clip_epsilon: float = 0.2
    """How far from 1 the ratio of probabilities counts."""
    entropy_coeff: float = 0.003
    """Weight of the entropy in the loss."""
    critic_coeff: float = 0.5
    """Weight of the critic's squared error in the loss."""
    max_grad_norm: float = 0.5
    """Of the gradient of actor and critic, each."""
    gamma: float = 0.99
    """Discount."""
    gae_lambda: float = 0.95
    """Of generalised advantages."""
    kl_stop: float = math.inf
    """The actor stands still for the rest of an update once the KL of a minibatch, see `estimated_kl`, exceeds this."""
    kl_target: float | None = None
    """Where the last KL of an update is above twice this, the actor's rate is divided by 1.5 for the next one; where it
    is below half of this, it is multiplied by as much, up to the rate itself. As a learned deviation shrinks, the same
    step of the mean action is a larger KL. None: off. Updates end at `kl_stop`: where it is less than twice this, the
    rate can hardly fall."""
    critic_warmup: int = 0
    """First updates in which the critic alone is trained."""
    rate_warmup: int = 0
    """First steps of the actor in which its rate grows linearly: Adam's very first steps have full size."""
    normalize_returns: bool = False
    """Divide rewards by the running deviation of discounted returns."""
    critic_bfloat16: bool = False
    """Whether the critic computes in bfloat16; its parameters and optimiser, and all of the actor, stay in float32."""
    compile: str | None = None
    """A mode of `torch.compile` for the loss of a minibatch; "reduce-overhead" makes CUDA graphs of it. None: eager."""

    def __post_init__(self) -> None:
        check_ranges(
            self,
            count=("epochs", "minibatch"),
            positive=(
                "learning_rate",
                "critic_learning_rate",
                "critic_coeff",
                "kl_target",
                "max_grad_norm",
            ),
            count_from_0=("critic_warmup", "rate_warmup"),
            not_negative=("entropy_coeff",),
            share=("gamma", "gae_lambda"),
            positive_share=("clip_epsilon",),
            limit=("kl_stop",),
        )
        if self.compile is not None:
            check_choices(self, compile=COMPILE_MODES)
