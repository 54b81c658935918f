"""Soft actor-critic that stays near a prior instead of staying random."""

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn
from torchrl.envs import ExplorationType, set_exploration_type
from torchrl.modules import ProbabilisticActor, ValueOperator
from torchrl.objectives import SACLoss

from tstar_rl.equations import divergence_dual_loss, gaussian_kl, prior_regularised_value


class PriorRegularisedSACLoss(SACLoss):
    """TorchRL's `SACLoss` with KL(pi(z | s) || p(z | s)) in the place of log pi(z | s).

    Everything else (two critics and their targets, the temporal difference, alpha as a parameter) is `SACLoss`'s own.
    "entropy" of its output is minus the divergence.

    Args:
        actor: pi, a diagonal Gaussian that writes "loc" and "scale".
        critic: Q.
        prior: p, observation (..., O) -> loc, scale (..., Z). It is only read.
        target_divergence: that alpha is tuned to.
        alpha: at the start.

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
    ) -> None:
        if not target_divergence > 0:
            raise ValueError(f"target_divergence must be positive, got {target_divergence}")
        super().__init__(
            actor, critic, alpha_init=alpha, target_entropy=-target_divergence, deactivate_vmap=True
        )
        self.target_divergence = target_divergence
        self.__dict__["prior"] = prior  # beside the module: its parameters are not this loss's to train

    def _draw(self, tensordict: TensorDictBase) -> tuple[Tensor, Tensor]:
        """A skill (..., Z) that the policy draws at "observation", and the divergence (...) there."""
        with (
            set_exploration_type(ExplorationType.RANDOM),
            self.actor_network_params.to_module(self.actor_network, preserve_module_state=False),
        ):
            dist = self.actor_network.get_dist(tensordict)
        with torch.no_grad():
            prior = self.prior(tensordict.get("observation"))
        return dist.rsample(), gaussian_kl(dist.base_dist.loc, dist.base_dist.scale, *prior)

    def actor_loss(self, tensordict: TensorDictBase) -> tuple[Tensor, dict[str, Tensor]]:
        """Minus the mean regularised value of the skills that the policy draws; the divergence goes to alpha."""
        skill, divergence = self._draw(tensordict)
        q = self._least_q(tensordict, skill, self._cached_detached_qvalue_params)
        loss = -prior_regularised_value(q, divergence, self._alpha).mean()
        return loss, {"log_prob": divergence.detach()}

    @torch.no_grad()
    def _compute_target_v2(self, tensordict: TensorDictBase) -> Tensor:
        """r + gamma (1 - terminated) (min Q'(s', z') - alpha KL), (batch,)."""
        tensordict = tensordict.clone(False)
        following: TensorDictBase = tensordict.get("next").copy()
        skill, divergence = self._draw(following)
        q = self._least_q(following, skill, self.target_qvalue_network_params)
        value = prior_regularised_value(q, divergence, self._alpha).unsqueeze(-1)
        tensordict.set("next", following.set(self.value_estimator.tensor_keys.value, value))
        return self.value_estimator.value_estimate(tensordict).squeeze(-1)

    def _least_q(self, tensordict: TensorDictBase, skill: Tensor, parameters: TensorDictBase) -> Tensor:
        """The lesser of the critics at "observation" and skill (..., Z), (...)."""
        inputs = tensordict.select("observation").set(self.tensor_keys.action, skill)
        assert self._vmap_qnetworkN0 is not None
        values = self._vmap_qnetworkN0(inputs, parameters).get(self.tensor_keys.state_action_value)
        return values.min(0)[0].squeeze(-1)

    def _alpha_loss(self, log_prob: Tensor) -> Tensor:
        return divergence_dual_loss(self.log_alpha, log_prob, self.target_divergence)
