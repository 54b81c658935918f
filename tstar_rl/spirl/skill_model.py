"""The networks of SPiRL: skills z of H actions, what they decode to, and which of them suit a state.

"SPiRL" is Pertsch et al., CoRL 2020. A skill here is its latent vector z, not a `Skill` of the chain.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from tensordict.nn import InteractionType, TensorDictModule
from torch import Tensor, nn
from torchrl.modules import MLP, IndependentNormal, ProbabilisticActor, ValueOperator

from tstar_rl.models.state_input import StateInput

__all__ = [
    "ClosedLoopDecoder",
    "OpenLoopDecoder",
    "SkillCritic",
    "SkillModel",
    "SkillModelSettings",
    "SkillPosterior",
    "SkillPrior",
    "make_skill_actor",
    "make_skill_critic",
]

ACTION = 9


@dataclass(frozen=True)
class SkillModelSettings:
    """Source: SPiRL's appendix for the defaults; the closed-loop decoder is the variant released with it."""

    horizon: int = 10
    """Actions H in a skill."""
    latent: int = 10
    """Numbers in z."""
    decoder: str = "open_loop"
    """"open_loop": z alone gives the H actions (the paper); "closed_loop": z and each state on the way."""
    recurrent_size: int = 128
    hidden: tuple[int, ...] = (128, 128, 128, 128, 128)
    """Of the prior, the policy, the critic and the closed-loop decoder."""

    def __post_init__(self) -> None:
        if self.decoder not in ("open_loop", "closed_loop"):
            raise ValueError(f"decoder must be 'open_loop' or 'closed_loop', got {self.decoder!r}")


def split_gaussian(x: Tensor) -> tuple[Tensor, Tensor]:
    """x: (..., 2 Z) -> loc (..., Z), scale (..., Z) in [e^-4, e^2]."""
    loc, log_scale = x.chunk(2, -1)
    return loc, log_scale.clamp(-4.0, 2.0).exp()


class SkillPosterior(nn.Module):
    """q(z | a_0 .. a_H-1): a recurrent network over the actions."""

    def __init__(self, settings: SkillModelSettings) -> None:
        super().__init__()
        self.recurrent = nn.LSTM(ACTION, settings.recurrent_size, batch_first=True)
        self.head = nn.Linear(settings.recurrent_size, 2 * settings.latent)

    def forward(self, actions: Tensor) -> tuple[Tensor, Tensor]:
        """actions: (B, H, 9) -> loc (B, Z), scale (B, Z)."""
        return split_gaussian(self.head(self.recurrent(actions)[0][:, -1]))


class OpenLoopDecoder(nn.Module):
    """z to H actions, whatever happens meanwhile. Source: SPiRL, section 3.1."""

    def __init__(self, settings: SkillModelSettings) -> None:
        super().__init__()
        self.horizon = settings.horizon
        self.recurrent = nn.LSTM(settings.latent, settings.recurrent_size, batch_first=True)
        self.head = nn.Linear(settings.recurrent_size, ACTION)

    def decode(self, skill: Tensor, observations: Tensor) -> Tensor:
        """skill: (B, Z), observations: (B, H, O), not read -> (B, H, 9)."""
        outputs, _ = self.recurrent(skill.unsqueeze(-2).expand(-1, self.horizon, -1))
        return self.head(outputs)

    def forward(self, skill: Tensor, observation: Tensor, step: Tensor) -> Tensor:
        """skill: (..., Z), observation: (..., O), step: (...) in 0 .. H-1 -> the skill's action there, (..., 9)."""
        actions = self.decode(skill.reshape(-1, skill.shape[-1]), observation)
        return actions[torch.arange(len(actions), device=actions.device), step.reshape(-1)].reshape(
            *step.shape, ACTION
        )


class ClosedLoopDecoder(nn.Module):
    """z and the present state to an action. Source: the variant of SPiRL in the code released with it."""

    def __init__(self, settings: SkillModelSettings, state: StateInput) -> None:
        super().__init__()
        self.horizon, self.state = settings.horizon, state
        self.mlp = MLP(
            in_features=state.out_dim + settings.latent,
            out_features=ACTION,
            num_cells=list(settings.hidden),
            activation_class=nn.ReLU,
        )

    def decode(self, skill: Tensor, observations: Tensor) -> Tensor:
        """skill: (B, Z), observations: (B, H, O) -> (B, H, 9)."""
        skills = skill.unsqueeze(-2).expand(-1, observations.shape[-2], -1)
        return self.mlp(torch.cat((self.state(observations), skills), -1))

    def forward(self, skill: Tensor, observation: Tensor, step: Tensor) -> Tensor:
        """skill: (..., Z), observation: (..., O), step: (...), not read -> (..., 9)."""
        return self.mlp(torch.cat((self.state(observation), skill), -1))


class SkillPrior(nn.Module):
    """p(z | s), and in its image the policy pi(z | s)."""

    def __init__(self, settings: SkillModelSettings, state: StateInput) -> None:
        super().__init__()
        self.state = state
        self.mlp = MLP(
            in_features=state.out_dim,
            out_features=2 * settings.latent,
            num_cells=list(settings.hidden),
            activation_class=nn.ReLU,
        )

    def forward(self, obs: Tensor) -> tuple[Tensor, Tensor]:
        """obs: (..., O) -> loc (..., Z), scale (..., Z)."""
        return split_gaussian(self.mlp(self.state(obs)))


class SkillCritic(nn.Module):
    """Q(s, z)."""

    def __init__(self, settings: SkillModelSettings, hidden: Sequence[int], state: StateInput) -> None:
        super().__init__()
        self.state = state
        self.mlp = MLP(
            in_features=state.out_dim + settings.latent,
            out_features=1,
            num_cells=list(hidden),
            activation_class=nn.ReLU,
        )

    def forward(self, obs: Tensor, skill: Tensor) -> Tensor:
        """obs: (..., O), skill: (..., Z) -> (..., 1)."""
        return self.mlp(torch.cat((self.state(obs), skill), -1))


class SkillModel(nn.Module):
    """Posterior, decoder and prior: what is learnt from demonstrations alone."""

    def __init__(self, settings: SkillModelSettings, state: StateInput) -> None:
        super().__init__()
        self.posterior = SkillPosterior(settings)
        closed = settings.decoder == "closed_loop"
        self.decoder = ClosedLoopDecoder(settings, state) if closed else OpenLoopDecoder(settings)
        self.prior = SkillPrior(settings, state)


def make_skill_actor(network: SkillPrior) -> ProbabilisticActor:
    """A Gaussian policy over skills: "observation" -> "loc", "scale", "skill", "skill_log_prob"."""
    module = TensorDictModule(network, in_keys=["observation"], out_keys=["loc", "scale"])
    return ProbabilisticActor(
        module,
        in_keys=["loc", "scale"],
        out_keys=["skill"],
        distribution_class=IndependentNormal,
        return_log_prob=True,
        default_interaction_type=InteractionType.RANDOM,
    )


def make_skill_critic(network: SkillCritic) -> ValueOperator:
    """Q as a module: "observation", "skill" -> "state_action_value" (..., 1)."""
    return ValueOperator(network, in_keys=["observation", "skill"], out_keys=["state_action_value"])
