"""SPiRL's second stage: soft actor-critic that keeps the policy over latents near the prior."""

from dataclasses import dataclass
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn
from torchrl.data import LazyTensorStorage, ReplayBuffer, TensorDictReplayBuffer
from torchrl.envs import ExplorationType, set_exploration_type
from torchrl.modules import ProbabilisticActor, ValueOperator
from torchrl.objectives import SACLoss, SoftUpdate

from tstar_rl.checks import check_choices, check_ranges, check_sizes
from tstar_rl.equations import divergence_dual_loss, gaussian_kl, prior_regularised_value
from tstar_rl.spirl.agent import SpirlAgent
from tstar_rl.spirl.model import LatentCritic, make_latent_critic

__all__ = [
    "TRANSITION",
    "LatentPolicySettings",
    "LatentPolicyUpdate",
    "PriorRegularisedSACLoss",
    "new_buffer",
]

TRANSITION = (
    "observation",
    "latent",
    *(("next", key) for key in ("observation", "reward", "done", "terminated")),
)
"""What the replay buffer keeps of a latent that was played: s, z, s', the summed reward, and how it ended."""
CRITIC_LOSSES = ("smooth_l1", "l2")


def new_buffer(capacity: int) -> TensorDictReplayBuffer:
    """A replay buffer for so many rows of `TRANSITION`."""
    return TensorDictReplayBuffer(storage=LazyTensorStorage(capacity))


@dataclass(frozen=True)
class LatentPolicySettings:
    """Source: SPiRL's appendix and the code released with it; configs/spirl/paper.yaml has their values."""

    critic_hidden: tuple[int, ...] = (256, 256, 256, 256, 256)
    target_divergence: float = 5.0
    """delta: alpha is tuned until KL(pi || p) is this large."""
    alpha: float = 0.1
    """At the start."""
    learning_rate: float = 3e-4
    minibatch: int = 256
    gamma: float = 0.99
    """Per latent, not per environment step."""
    tau: float = 0.005
    """Share of the critics that the target critics take over at each minibatch."""
    updates: float = 1.0
    """Minibatches for each latent that was played."""
    first: int = 500
    """Latents in the buffer before the first update."""
    critic_warmup: int = 0
    """Number of first minibatches that train the critics alone."""
    critic_loss: str = "smooth_l1"
    """Of the temporal difference: smooth_l1 or, as in the released code, l2 (decision 0009)."""
    max_grad_norm: float | None = 10.0
    """Of the gradients of critics, policy and alpha, each; None, as in the released code: they are not clipped."""

    def __post_init__(self) -> None:
        check_ranges(
            self,
            count=("minibatch", "first"),
            positive=("target_divergence", "alpha", "learning_rate", "updates", "max_grad_norm"),
            count_from_0=("critic_warmup",),
            share=("gamma",),
            positive_share=("tau",),
        )
        check_sizes(self, "critic_hidden")
        check_choices(self, critic_loss=CRITIC_LOSSES)


class PriorRegularisedSACLoss(SACLoss):
    """TorchRL's `SACLoss` with KL(pi(z | s) || p(z | s)) in place of log pi(z | s).

    The rest is `SACLoss`: two critics and their targets, the temporal difference, alpha as a parameter. The output
    "entropy" is minus the divergence.

    Args:
        actor: pi, a diagonal Gaussian that writes "loc" and "scale".
        critic: Q.
        prior: p, observation (..., O) -> loc, scale (..., Z). It is read, not trained.
        target_divergence: the divergence that alpha is tuned to.
        alpha: at the start.
        critic_loss: of the temporal difference, see `LatentPolicySettings`.

    Raises:
        ValueError: if the target is not positive.

    Source: SPiRL, algorithm 1.
    """

    def __init__(
        self,
        actor: ProbabilisticActor,
        critic: ValueOperator,
        prior: nn.Module,
        target_divergence: float,
        alpha: float = 0.1,
        critic_loss: str = "smooth_l1",
    ) -> None:
        if not target_divergence > 0:
            raise ValueError(f"target_divergence must be positive, got {target_divergence}")
        super().__init__(
            actor, critic, alpha_init=alpha, target_entropy=-target_divergence, deactivate_vmap=True,
            loss_function=critic_loss,
        )  # fmt: skip
        self.target_divergence = target_divergence
        self.__dict__["prior"] = prior  # not a submodule: this loss must not train its parameters

    def _draw(self, tensordict: TensorDictBase) -> tuple[Tensor, Tensor]:
        """A latent (..., Z) drawn from the policy at "observation", and the divergence (...) there."""
        with (
            set_exploration_type(ExplorationType.RANDOM),
            self.actor_network_params.to_module(self.actor_network, preserve_module_state=False),
        ):
            dist = self.actor_network.get_dist(tensordict)
        with torch.no_grad():
            prior = self.prior(tensordict.get("observation"))
        return dist.rsample(), gaussian_kl(dist.base_dist.loc, dist.base_dist.scale, *prior)

    def actor_loss(self, tensordict: TensorDictBase) -> tuple[Tensor, dict[str, Tensor]]:
        """Minus the mean regularised value of the latents that the policy draws; the divergence is for alpha."""
        latent, divergence = self._draw(tensordict)
        q = self._least_q(tensordict, latent, self._cached_detached_qvalue_params)
        loss = -prior_regularised_value(q, divergence, self._alpha).mean()
        return loss, {"log_prob": divergence.detach()}

    @torch.no_grad()
    def _compute_target_v2(self, tensordict: TensorDictBase) -> Tensor:
        """r + gamma (1 - terminated) (min Q'(s', z') - alpha KL), (batch,)."""
        tensordict = tensordict.clone(False)
        following: TensorDictBase = tensordict.get("next").copy()
        latent, divergence = self._draw(following)
        q = self._least_q(following, latent, self.target_qvalue_network_params)
        value = prior_regularised_value(q, divergence, self._alpha).unsqueeze(-1)
        tensordict.set("next", following.set(self.value_estimator.tensor_keys.value, value))
        return self.value_estimator.value_estimate(tensordict).squeeze(-1)

    def _least_q(self, tensordict: TensorDictBase, latent: Tensor, parameters: TensorDictBase) -> Tensor:
        """The smaller of the two critics' values at "observation" and latent (..., Z), (...)."""
        inputs = tensordict.select("observation").set(self.tensor_keys.action, latent)
        assert self._vmap_qnetworkN0 is not None
        values = self._vmap_qnetworkN0(inputs, parameters).get(self.tensor_keys.state_action_value)
        return values.min(0)[0].squeeze(-1)

    def _alpha_loss(self, log_prob: Tensor) -> Tensor:
        return divergence_dual_loss(self.log_alpha, log_prob, self.target_divergence)


class LatentPolicyUpdate:
    """Trains critics, policy and alpha on minibatches from a replay buffer.

    Args:
        agent: its policy is changed in place, its prior is only read. The critics copy its normaliser: fit it before.
        settings: see `LatentPolicySettings`.
    """

    def __init__(self, agent: SpirlAgent, settings: LatentPolicySettings) -> None:
        self.settings, self.minibatches, self.owed = settings, 0, 0.0
        self.device = next(agent.actor.parameters()).device
        latent_dim = agent.settings.latent_dim
        network = LatentCritic(latent_dim, settings.critic_hidden, agent.state).to(self.device)
        self.loss = PriorRegularisedSACLoss(
            agent.actor,
            make_latent_critic(network),
            agent.model.prior,
            settings.target_divergence,
            settings.alpha,
            settings.critic_loss,
        )
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

    def __call__(self, buffer: ReplayBuffer, latents: int) -> dict[str, float]:
        """Trains for `latents` new ones in the buffer and returns mean losses for the log; {} if it holds too few.

        A part of a minibatch is owed to later calls. The buffer may be on another device than the networks.
        """
        if len(buffer) < self.settings.first:
            return {}
        self.owed += self.settings.updates * latents
        number = round(self.owed)
        self.owed -= number
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
            if self.settings.max_grad_norm is not None:
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
        """Critics and their targets, alpha, optimisers, and how many minibatches were made and are owed."""
        return {
            "loss": {k: v for k, v in self.loss.state_dict().items() if isinstance(v, torch.Tensor)},
            "optimizers": {name: optimizer.state_dict() for name, optimizer in self.optimizers.items()},
            "minibatches": self.minibatches,
            "owed": self.owed,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Takes what `state_dict` gave."""
        self.loss.load_state_dict({**self.loss.state_dict(), **state["loss"]})
        for name, optimizer in self.optimizers.items():
            optimizer.load_state_dict(state["optimizers"][name])
        self.minibatches = int(state["minibatches"])
        self.owed = float(state.get("owed", 0.0))  # a checkpoint of an older version owes nothing
