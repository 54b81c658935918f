"""Prior-regularised soft actor-critic of the policy over skills."""

from dataclasses import dataclass
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import nn
from torchrl.data import ReplayBuffer
from torchrl.modules import ProbabilisticActor, ValueOperator
from torchrl.objectives import SoftUpdate

from tstar_rl.checks import check_ranges
from tstar_rl.spirl.prior_regularised_sac import PriorRegularisedSACLoss

TRANSITION = (
    "observation",
    "skill",
    *(("next", key) for key in ("observation", "reward", "done", "terminated")),
)


@dataclass(frozen=True)
class SkillPolicySettings:
    """Source: SPiRL's appendix and the code released with it for the defaults."""

    target_divergence: float = 5.0
    alpha: float = 0.1
    """At the start."""
    learning_rate: float = 3e-4
    minibatch: int = 256
    gamma: float = 0.99
    """Of a skill, not of a step."""
    tau: float = 0.005
    """Share by which the target critics follow."""
    updates: float = 1.0
    """Minibatches for each skill that was played."""
    first: int = 500
    """Skills in the buffer before the first update."""
    critic_warmup: int = 0
    """First minibatches in which the critics alone are trained."""
    max_grad_norm: float = 10.0

    def __post_init__(self) -> None:
        check_ranges(
            self,
            count=("minibatch", "first"),
            positive=("target_divergence", "alpha", "learning_rate", "updates", "max_grad_norm"),
            not_negative=("critic_warmup",),
            share=("gamma",),
            positive_share=("tau",),
        )


class SkillPolicyUpdate:
    """Minibatches from a replay buffer for the critics, the actor and alpha.

    Args:
        actor: pi, changed in place.
        critic: Q, with its normaliser fitted; the two critics are made after its image.
        prior: p, only read.
        settings: see `SkillPolicySettings`.
    """

    def __init__(
        self,
        actor: ProbabilisticActor,
        critic: ValueOperator,
        prior: nn.Module,
        settings: SkillPolicySettings,
    ) -> None:
        self.settings, self.minibatches = settings, 0
        self.device = next(actor.parameters()).device
        self.loss = PriorRegularisedSACLoss(actor, critic, prior, settings.target_divergence, settings.alpha)
        self.loss.make_value_estimator(gamma=settings.gamma)
        self.targets = SoftUpdate(self.loss, tau=settings.tau)
        self.parameters = {
            "qvalue": list(self.loss.qvalue_network_params.parameters()),
            "actor": list(self.loss.actor_network_params.parameters()),
            "alpha": [self.loss.log_alpha],
        }
        self.optimizers = {
            name: torch.optim.Adam(parameters, settings.learning_rate)
            for name, parameters in self.parameters.items()
        }

    def __call__(self, buffer: ReplayBuffer, skills: int) -> dict[str, float]:
        """The minibatches that `skills` more in the buffer stand for; means of what they say, for the log.

        The buffer may be on another device than the networks.
        """
        number = round(self.settings.updates * skills) if len(buffer) >= self.settings.first else 0
        sums: dict[str, float] = {}
        for _ in range(number):
            for key, value in self._step(buffer.sample(self.settings.minibatch).to(self.device)).items():
                sums[key] = sums.get(key, 0.0) + value / number
        return sums

    def _step(self, batch: TensorDictBase) -> dict[str, float]:
        out = self.loss(batch)
        self.minibatches += 1
        names = ["qvalue"]
        if self.minibatches > self.settings.critic_warmup:
            names += ["actor", "alpha"]
        for name in names:
            self.optimizers[name].zero_grad()
        torch.stack([out[f"loss_{name}"] for name in names]).sum().backward()
        for name in names:
            nn.utils.clip_grad_norm_(self.parameters[name], self.settings.max_grad_norm)
            self.optimizers[name].step()
        self.targets.step()
        return {
            "loss_qvalue": float(out["loss_qvalue"].detach()),
            "loss_actor": float(out["loss_actor"].detach()),
            "divergence": -float(out["entropy"]),
            "alpha": float(out["alpha"]),
        }

    def state_dict(self) -> dict[str, Any]:
        """Critics and targets, alpha, optimisers."""
        return {
            "loss": {k: v for k, v in self.loss.state_dict().items() if isinstance(v, torch.Tensor)},
            "optimizers": {name: optimizer.state_dict() for name, optimizer in self.optimizers.items()},
            "minibatches": self.minibatches,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """What `state_dict` gave."""
        self.loss.load_state_dict({**self.loss.state_dict(), **state["loss"]})
        for name, optimizer in self.optimizers.items():
            optimizer.load_state_dict(state["optimizers"][name])
        self.minibatches = int(state["minibatches"])
