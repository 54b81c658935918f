"""The networks: policy, value, the discriminators f_phi and d_omega, and what their inputs pass through.

All of them read "observation" (..., obs_dim) as the environment gives it. An optional `Normalizer` and optional
`RelativeFeatures` are part of a network, so that a saved network needs nothing beside it.
"""

from collections.abc import Callable, Sequence
from typing import cast

import torch
from tensordict.nn import (
    InteractionType,
    ProbabilisticTensorDictSequential,
    TensorDictModule,
    TensorDictSequential,
)
from torch import Tensor, nn
from torch.nn.functional import softplus
from torchrl.modules import MLP, IndependentNormal, ProbabilisticActor, ValueOperator

from tstar_rl.checks import InvalidValueError
from tstar_rl.models.normalizer import Normalizer
from tstar_rl.models.precision import in_bfloat16
from tstar_rl.models.relative_features import RelativeFeatures
from tstar_rl.models.state_input import StateInput

__all__ = [
    "Discriminator",
    "GaussianHead",
    "make_discriminator",
    "make_policy",
    "make_value",
    "set_action_std",
    "split_encoder",
    "split_policy",
]


def _mlp(
    in_dim: int, out_dim: int, hidden: Sequence[int], activation: type[nn.Module], out_gain: float
) -> MLP:
    mlp = MLP(in_features=in_dim, out_features=out_dim, num_cells=list(hidden), activation_class=activation)
    last = cast(nn.Linear, mlp[-1])
    nn.init.orthogonal_(last.weight, out_gain)
    nn.init.zeros_(last.bias)
    return mlp


def _encoder(state_input: StateInput) -> TensorDictModule:
    """Map from "observation" to "encoded"."""
    return TensorDictModule(state_input, in_keys=["observation"], out_keys=["encoded"])


class GaussianHead(nn.Module):
    """Turns a network's outputs into the location and deviation of a Gaussian over actions.

    Args:
        action_dim: A.
        std: "state": the deviation is an output of the network, through a softplus (the paper);
            "fixed": it is a buffer that `set_action_std` writes.
        action_std: deviation at the start, one number or A of them.

    Raises:
        ValueError: if `std` is neither, or `action_std` is not positive or has the wrong length.
    """

    min_std = 1e-4
    std: Tensor

    def __init__(self, action_dim: int, std: str, action_std: float | Sequence[float] | Tensor) -> None:
        super().__init__()
        if std not in ("state", "fixed"):
            raise ValueError(f"std must be 'state' or 'fixed', got {std!r}")
        self.state_dependent = std == "state"
        self.in_dim = 2 * action_dim if self.state_dependent else action_dim
        self.register_buffer("std", torch.ones(action_dim))
        self.set_std(action_std)

    @torch.no_grad()
    def set_std(self, action_std: float | Sequence[float] | Tensor) -> None:
        """Writes the deviation ("fixed"), or the deviation at a zero output ("state"), in place."""
        value = torch.as_tensor(action_std, dtype=self.std.dtype, device=self.std.device)
        if value.shape not in ((), self.std.shape) or not bool((value > 0).all()):
            raise ValueError(
                f"action_std must be one positive number or {self.std.shape[0]} of them, got {action_std!r}"
            )
        self.std.copy_(value)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """x: (..., in_dim) -> loc (..., A) in [-1, 1], scale (..., A) > 0."""
        if not self.state_dependent:
            loc = x.tanh()
            return loc, self.std.expand_as(loc).clone()  # a rollout must not change with the buffer
        loc, raw = x.chunk(2, -1)
        offset = self.std.expm1().log()  # softplus(offset) = std
        return loc.tanh(), softplus(raw + offset).clamp_min(self.min_std)


def make_policy(
    obs_dim: int,
    action_dim: int = 9,
    hidden: Sequence[int] = (128, 256),
    activation: type[nn.Module] = nn.ReLU,
    std: str = "state",
    action_std: float | Sequence[float] | Tensor = 0.1,
    normalizer: Normalizer | None = None,
    features: RelativeFeatures | None = None,
) -> ProbabilisticActor:
    """A Gaussian policy: "observation" -> "loc", "scale", "action", "action_log_prob".

    The location is a tanh; a sample may leave [-1, 1] and is clipped by the environment, so that its log
    probability stays exact. Sampling follows TorchRL's `set_exploration_type`.

    Source: the paper's appendix B, of which `scale=paper` has the sizes.
    """
    head = GaussianHead(action_dim, std, action_std)
    state_input = StateInput(obs_dim, normalizer, features)
    mlp = _mlp(state_input.out_dim, head.in_dim, hidden, activation, out_gain=0.01)
    body = TensorDictModule(nn.Sequential(mlp, head), in_keys=["encoded"], out_keys=["loc", "scale"])
    module = TensorDictSequential(_encoder(state_input), body, selected_out_keys=["loc", "scale"])
    return ProbabilisticActor(
        module,
        in_keys=["loc", "scale"],
        distribution_class=IndependentNormal,
        return_log_prob=True,
        default_interaction_type=InteractionType.RANDOM,
    )


def _head(policy: nn.Module) -> GaussianHead:
    for module in policy.modules():
        if isinstance(module, GaussianHead):
            return module
    raise ValueError(f"no GaussianHead in this {type(policy).__name__}: was it made by make_policy?")


def set_action_std(policy: nn.Module, action_std: float | Sequence[float] | Tensor) -> None:
    """Writes the exploration deviation of a policy with std="fixed", in place.

    Raises:
        ValueError: if the policy's deviation depends on the state, or the value is not valid.
    """
    head = _head(policy)
    if head.state_dependent:
        raise ValueError(
            "the deviation of this policy is learned (std='state'): set_action_std needs std='fixed'"
        )
    head.set_std(action_std)


def make_value(
    obs_dim: int,
    hidden: Sequence[int] = (128, 256),
    activation: type[nn.Module] = nn.ReLU,
    normalizer: Normalizer | None = None,
    features: RelativeFeatures | None = None,
) -> TensorDictSequential:
    """A value network: "observation" (..., obs_dim) -> "state_value" (..., 1).

    Source: the paper's appendix B, of which `scale=paper` has the sizes.
    """
    state_input = StateInput(obs_dim, normalizer, features)
    mlp = _mlp(state_input.out_dim, 1, hidden, activation, out_gain=1.0)
    body = ValueOperator(mlp, in_keys=["encoded"])
    return TensorDictSequential(_encoder(state_input), body, selected_out_keys=["state_value"])


def split_policy(policy: ProbabilisticActor) -> tuple[TensorDictModule, TensorDictModule]:
    """What a policy from `make_policy` is made of: "observation" -> "encoded" without parameters -> "loc", "scale"."""
    encoder, body = (cast(TensorDictModule, module) for module in cast(TensorDictSequential, policy[0]))
    return encoder, body


def split_encoder(
    policy: ProbabilisticActor, value: TensorDictSequential
) -> tuple[TensorDictModule, ProbabilisticTensorDictSequential, TensorDictModule]:
    """What policy and value of one skill share, and what is left of each: so that it is computed once for both.

    Args:
        policy: from `make_policy`.
        value: from `make_value`, with the normaliser and features of the policy.

    Returns:
        The encoder, "observation" -> "encoded"; the policy and the value network on "encoded". Parameters are shared.

    Raises:
        InvalidValueError: if they do not see the same: the value network would learn on the policy's inputs.
    """
    encoder, body = split_policy(policy)
    seen, valued = (cast(StateInput, each.module) for each in (encoder, cast(TensorDictModule, value[0])))
    plain = isinstance(seen.normalizer, nn.Identity) and isinstance(valued.normalizer, nn.Identity)
    if not (plain or seen.normalizer is valued.normalizer) or seen.features is not valued.features:
        raise InvalidValueError(
            "policy and value must be made with one normaliser and one RelativeFeatures, or both without: what they "
            "see of an observation is computed once for both"
        )
    actor = ProbabilisticTensorDictSequential(body, policy[-1])
    return encoder, actor, cast(TensorDictModule, value[-1])


class Discriminator(nn.Module):
    """A score of observations. `normalize` and `score` are apart so that a gradient can be taken between them.

    Args:
        network: (..., obs_dim) -> (..., 1), on normalised observations.
        normalizer: what comes before it; None passes observations through.
    """

    def __init__(self, network: nn.Module, normalizer: Callable[[Tensor], Tensor] | None = None) -> None:
        super().__init__()
        self.network = network
        self.normalizer = normalizer
        self.coarse = False  # compute in bfloat16; set by what trains it

    def normalize(self, obs: Tensor) -> Tensor:
        """obs: (..., obs_dim) -> the same shape, as the network reads it."""
        return obs if self.normalizer is None else self.normalizer(obs)

    def score(self, normalized: Tensor) -> Tensor:
        """normalized: (..., obs_dim) -> (..., 1), raw."""
        return in_bfloat16(self.network, normalized) if self.coarse else self.network(normalized)

    def forward(self, obs: Tensor) -> Tensor:
        """obs: (..., obs_dim) -> (..., 1), raw."""
        return self.score(self.normalize(obs))


def make_discriminator(
    obs_dim: int,
    hidden: Sequence[int] = (256, 256),
    activation: type[nn.Module] = nn.Tanh,
    normalizer: Normalizer | None = None,
) -> Discriminator:
    """f_phi or d_omega: (..., obs_dim) -> (..., 1), unbounded.

    Source: the paper's appendix B.
    """
    mlp = MLP(in_features=obs_dim, out_features=1, num_cells=list(hidden), activation_class=activation)
    return Discriminator(mlp, normalizer)
