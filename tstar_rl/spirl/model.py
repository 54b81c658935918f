"""SPiRL's networks: posterior, decoder and prior of the latents; the policy over latents and its critic."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import torch
from tensordict import TensorDictBase
from tensordict.nn import InteractionType, TensorDictModule
from torch import Tensor, nn
from torchrl.modules import MLP, IndependentNormal, ProbabilisticActor, ValueOperator

from tstar_rl.checks import check_choices, check_ranges, check_sizes
from tstar_rl.models.state_input import StateInput

__all__ = [
    "ClosedLoopDecoder",
    "LatentCritic",
    "LatentModel",
    "LatentModelSettings",
    "LatentPosterior",
    "LatentPrior",
    "OpenLoopDecoder",
    "make_latent_actor",
    "make_latent_critic",
]

ACTION = 9


@dataclass(frozen=True)
class LatentModelSettings:
    """Source: SPiRL's appendix for the defaults; the closed-loop decoder is a variant in the released code."""

    horizon: int = 10
    """H, the actions that one latent stands for."""
    latent_dim: int = 10
    """Z, the numbers in a latent z."""
    decoder: str = "open_loop"
    """"open_loop": the H actions depend on z alone (the paper). "closed_loop": each also depends on its state."""
    recurrent_size: int = 128
    hidden: tuple[int, ...] = (128, 128, 128, 128, 128)
    """Layers of the prior, of the policy and of the closed-loop decoder."""

    def __post_init__(self) -> None:
        check_ranges(self, count=("horizon", "latent_dim", "recurrent_size"))
        check_sizes(self, "hidden")
        check_choices(self, decoder=("open_loop", "closed_loop"))


def _mlp(inputs: int, outputs: int, hidden: Sequence[int]) -> MLP:
    return MLP(in_features=inputs, out_features=outputs, num_cells=list(hidden), activation_class=nn.ReLU)


def _split_gaussian(x: Tensor) -> tuple[Tensor, Tensor]:
    """x: (..., 2 Z) -> loc (..., Z), scale (..., Z) in [e^-4, e^2]."""
    loc, log_scale = x.chunk(2, -1)
    return loc, log_scale.clamp(-4.0, 2.0).exp()


class LatentPosterior(nn.Module):
    """q(z | a_0 .. a_H-1): a recurrent network over the actions.

    The released closed-loop model also reads the states: docs/decisions/0009-spirl.md.
    """

    def __init__(self, settings: LatentModelSettings) -> None:
        super().__init__()
        self.recurrent = nn.LSTM(ACTION, settings.recurrent_size, batch_first=True)
        self.head = nn.Linear(settings.recurrent_size, 2 * settings.latent_dim)

    def forward(self, actions: Tensor) -> tuple[Tensor, Tensor]:
        """actions: (B, H, 9) -> loc (B, Z), scale (B, Z)."""
        return _split_gaussian(self.head(self.recurrent(actions)[0][:, -1]))


class OpenLoopDecoder(nn.Module):
    """Decodes z into H actions without looking at the states on the way. Source: SPiRL, section 3.1."""

    def __init__(self, settings: LatentModelSettings) -> None:
        super().__init__()
        self.horizon = settings.horizon
        self.recurrent = nn.LSTM(settings.latent_dim, settings.recurrent_size, batch_first=True)
        self.head = nn.Linear(settings.recurrent_size, ACTION)

    def decode(self, latent: Tensor, observations: Tensor) -> Tensor:
        """latent: (B, Z), observations: (B, H, O), not read -> all actions (B, H, 9)."""
        outputs, _ = self.recurrent(latent.unsqueeze(-2).expand(-1, self.horizon, -1))
        return self.head(outputs)

    def forward(self, latent: Tensor, observation: Tensor, step: Tensor) -> Tensor:
        """latent: (..., Z), observation: (..., O), step: (...) in 0 .. H-1 -> the action of that step (..., 9)."""
        actions = self.decode(latent.reshape(-1, latent.shape[-1]), observation)
        rows = torch.arange(len(actions), device=actions.device)
        return actions[rows, step.reshape(-1)].reshape(*step.shape, ACTION)


class ClosedLoopDecoder(nn.Module):
    """Decodes z and the current state into one action. Source: the code of SPiRL, whose posterior differs."""

    def __init__(self, settings: LatentModelSettings, state: StateInput) -> None:
        super().__init__()
        self.horizon, self.state = settings.horizon, state
        self.mlp = _mlp(state.out_dim + settings.latent_dim, ACTION, settings.hidden)

    def decode(self, latent: Tensor, observations: Tensor) -> Tensor:
        """latent: (B, Z), observations: (B, H, O) -> all actions (B, H, 9)."""
        latents = latent.unsqueeze(-2).expand(-1, observations.shape[-2], -1)
        return self.mlp(torch.cat((self.state(observations), latents), -1))

    def forward(self, latent: Tensor, observation: Tensor, step: Tensor) -> Tensor:
        """latent: (..., Z), observation: (..., O), step: (...), not read -> the action of that step (..., 9)."""
        return self.mlp(torch.cat((self.state(observation), latent), -1))


class LatentPrior(nn.Module):
    """p(z | s). The policy pi(z | s) is a network of the same shape."""

    def __init__(self, settings: LatentModelSettings, state: StateInput) -> None:
        super().__init__()
        self.state = state
        self.mlp = _mlp(state.out_dim, 2 * settings.latent_dim, settings.hidden)

    def forward(self, obs: Tensor) -> tuple[Tensor, Tensor]:
        """obs: (..., O) -> loc (..., Z), scale (..., Z)."""
        return _split_gaussian(self.mlp(self.state(obs)))


class LatentModel(nn.Module):
    """Posterior, decoder and prior: everything that is learned from demonstrations alone."""

    def __init__(self, settings: LatentModelSettings, state: StateInput) -> None:
        super().__init__()
        self.posterior = LatentPosterior(settings)
        closed = settings.decoder == "closed_loop"
        self.decoder = ClosedLoopDecoder(settings, state) if closed else OpenLoopDecoder(settings)
        self.prior = LatentPrior(settings, state)

    @torch.no_grad()
    def errors(self, windows: TensorDictBase) -> dict[str, float]:
        """Mean squared errors of decoded actions, and the variance of the actions to compare them with.

        "held_out_error" decodes the posterior's mean, which has seen the actions. "held_out_prior_error" decodes the
        prior's mean, which has seen the first state only.

        Args:
            windows: "action" (W, H, 9), "observation" (W, H, O), not trained on.
        """
        actions, observations = cast(Tensor, windows["action"]), cast(Tensor, windows["observation"])

        def error(latent: Tensor) -> float:
            return float((self.decoder.decode(latent, observations) - actions).square().mean())

        return {
            "held_out_error": error(self.posterior(actions)[0]),
            "held_out_prior_error": error(self.prior(observations[:, 0])[0]),
            "held_out_variance": float(actions.flatten(0, 1).var(0, unbiased=False).mean()),
        }


class LatentCritic(nn.Module):
    """Q(s, z)."""

    def __init__(self, latent_dim: int, hidden: Sequence[int], state: StateInput) -> None:
        super().__init__()
        self.state = state
        self.mlp = _mlp(state.out_dim + latent_dim, 1, hidden)

    def forward(self, obs: Tensor, latent: Tensor) -> Tensor:
        """obs: (..., O), latent: (..., Z) -> (..., 1)."""
        return self.mlp(torch.cat((self.state(obs), latent), -1))


def make_latent_actor(network: nn.Module) -> ProbabilisticActor:
    """A Gaussian policy over latents: "observation" -> "loc", "scale", "latent", "latent_log_prob".

    Args:
        network: observation (..., O) -> loc, scale (..., Z), such as a `LatentPrior`.
    """
    module = TensorDictModule(network, in_keys=["observation"], out_keys=["loc", "scale"])
    return ProbabilisticActor(
        module,
        in_keys=["loc", "scale"],
        out_keys=["latent"],
        distribution_class=IndependentNormal,
        return_log_prob=True,
        default_interaction_type=InteractionType.RANDOM,
    )


def make_latent_critic(network: nn.Module) -> ValueOperator:
    """Q as a module: "observation", "latent" -> "state_action_value" (..., 1).

    Args:
        network: observation (..., O), latent (..., Z) -> (..., 1), such as a `LatentCritic`.
    """
    return ValueOperator(network, in_keys=["observation", "latent"], out_keys=["state_action_value"])
