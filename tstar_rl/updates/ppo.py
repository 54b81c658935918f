"""Proximal policy optimisation of a policy and its value network."""

import math
from functools import partial
from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictSequential
from torch import Tensor, nn
from torchrl.modules import ProbabilisticActor, ValueOperator
from torchrl.objectives import ClipPPOLoss
from torchrl.objectives.value import GAE

from tstar_rl.checks import InvalidValueError
from tstar_rl.models.blocks import in_blocks
from tstar_rl.models.networks import split_encoder
from tstar_rl.models.precision import Bfloat16
from tstar_rl.models.return_scale import ReturnScale
from tstar_rl.updates.minibatches import nearly_equal
from tstar_rl.updates.ppo_settings import PPOSettings

LEAST_SHARE = 0.01
"""Of the actor's rate, however large the KL."""
PPO_KEYS = ("encoded", "action", "action_log_prob", "advantage", "value_target")


class PolicyUpdate:
    """Proximal policy optimisation of a policy and its value network on one rollout.

    Args:
        policy: from `make_policy`.
        value: from `make_value`, of the same skill.
        settings: see `PPOSettings`.
        return_scale: used and updated if the settings say so.
        seed: of the order of minibatches.

    Source: Schulman et al. 2017, 2016; the paper's appendix.
    """

    def __init__(
        self,
        policy: ProbabilisticActor,
        value: TensorDictSequential,
        settings: PPOSettings,
        return_scale: ReturnScale,
        seed: int = 0,
    ) -> None:
        self.settings = settings
        self.return_scale = return_scale
        self.device = next(policy.parameters()).device
        self.generator = torch.Generator(self.device).manual_seed(seed)
        self.updates = self.actor_steps = 0
        self.actor_rate = settings.learning_rate
        self.rate_share = 1.0
        self.carried = torch.zeros((), device=self.device)
        self.encoder, actor, self.critic = split_encoder(policy, value)
        if settings.critic_bfloat16:
            self.critic = ValueOperator(Bfloat16(self.critic.module), in_keys=["encoded"])
        self.loss = ClipPPOLoss(
            actor,
            self.critic,
            clip_epsilon=settings.clip_epsilon,
            entropy_bonus=settings.entropy_coeff > 0,
            entropy_coeff=settings.entropy_coeff,
            critic_coeff=settings.critic_coeff,
            loss_critic_type="l2",
            normalize_advantage=True,
            functional=False,
        )
        self.losses = (
            self.loss if settings.compile is None else torch.compile(self.loss, mode=settings.compile)
        )
        self.gae = GAE(
            gamma=settings.gamma,
            lmbda=settings.gae_lambda,
            value_network=None,
            deactivate_vmap=True,
        )
        self.actor_parameters, self.critic_parameters = list(actor.parameters()), list(value.parameters())
        critic_rate = settings.critic_learning_rate or settings.learning_rate
        adam = partial(torch.optim.Adam, eps=1e-5, fused=True)
        self.actor_optimizer = adam(self.actor_parameters, lr=settings.learning_rate)
        self.critic_optimizer = adam(self.critic_parameters, lr=critic_rate)

    def __call__(self, rollout: TensorDictBase, progress: float = 0.0) -> dict[str, float]:
        """One update on a rollout (N, T) with ("next", "reward"); progress in [0, 1] drives the linear decay.

        Raises:
            InvalidValueError: if the rollout has another shape: T steps of each of N simulations.
        """
        if rollout.ndim != 2:
            raise InvalidValueError(
                "PPO learns from a rollout (simulations, steps); got batch size "
                f"{list(rollout.batch_size)}. reshape(-1, steps) puts workers' simulations beside each other"
            )
        self._set_learning_rates(progress)
        batch = self._with_advantage(rollout)
        actor_moves = self.updates >= self.settings.critic_warmup
        nothing = torch.zeros((), dtype=torch.float64, device=self.device)
        log: dict[str, Any] = dict.fromkeys(("kl", "loss_policy", "loss_critic"), nothing)
        log |= {"actor_steps": 0, "critic_steps": 0}
        for _ in range(self.settings.epochs):
            order = torch.randperm(batch.shape[0], generator=self.generator, device=self.device)
            for rows in nearly_equal(order, self.settings.minibatch):
                actor_moves = self._step(batch[rows], actor_moves, log)
        self.updates += 1
        if self.settings.kl_target is not None and log["actor_steps"]:
            self.rate_share = adapted_share(self.rate_share, float(log["kl"]), self.settings.kl_target)
            log["rate_share"] = self.rate_share
        log["loss_policy"] = log["loss_policy"] / max(log["actor_steps"], 1)
        log["loss_critic"] = log["loss_critic"] / max(log["critic_steps"], 1)
        return {name: float(value) if isinstance(value, Tensor) else value for name, value in log.items()}

    def _step(self, batch: TensorDictBase, actor_moves: bool, log: dict[str, Any]) -> bool:
        """One minibatch; returns whether the actor may still move in this update.

        What is logged stays on the device. The host waits for it only where a KL may stop the actor.
        """
        if actor_moves:
            losses = self.losses(batch)
            log["kl"] = estimated_kl(losses["mean_ratio"], losses["kl_approx"].detach())
            actor_moves = math.isinf(self.settings.kl_stop) or float(log["kl"]) <= self.settings.kl_stop
        loss = critic_loss = losses["loss_critic"] if actor_moves else self.loss.loss_critic(batch)[0].mean()
        if actor_moves:
            policy_loss = losses["loss_objective"] + losses.get("loss_entropy", 0.0)
            loss = policy_loss + critic_loss  # no parameter is in both; a compiled loss has one backward pass
            self.actor_steps += 1
            warmth = min(self.actor_steps / max(self.settings.rate_warmup, 1), 1.0)
            self.actor_optimizer.param_groups[0]["lr"] = warmth * self.rate_share * self.actor_rate
            log["loss_policy"] = log["loss_policy"] + policy_loss.detach()
            log["actor_steps"] += 1
        learners = [(self.critic_optimizer, self.critic_parameters)]
        learners += [(self.actor_optimizer, self.actor_parameters)] if actor_moves else []
        _descend(loss, learners, self.settings.max_grad_norm)
        log["loss_critic"] = log["loss_critic"] + critic_loss.detach()
        log["critic_steps"] += 1
        return actor_moves

    @torch.no_grad()
    def _with_advantage(self, rollout: TensorDictBase) -> TensorDictBase:
        keys = ("reward", "done", "terminated", "observation")
        batch = rollout.select("observation", "action", "action_log_prob", *(("next", key) for key in keys))
        if self.settings.normalize_returns:
            carried = self._carried_into(rollout)
            paid, done = batch["next", "reward"], batch["next", "done"]
            reward, self.carried = self.return_scale(paid, done, carried, self.settings.gamma)
            following = batch["next"].copy()  # pyright: ignore[reportAttributeAccessIssue]
            batch = batch.copy().set("next", following.set("reward", reward))
        return self.gae(self._with_values(batch)).select(*PPO_KEYS).reshape(-1)

    def _carried_into(self, rollout: TensorDictBase) -> Tensor:
        """The returns so far, (N, 1), of the episodes that run on into a rollout (N, T); 0 where one begins with it.

        Simulations that were made anew run none of the episodes of the rollout before, which did not end either.
        """
        number, steps = rollout.shape[0], rollout.get(("next", "step_count"), None)
        same = not self.carried.ndim or len(self.carried) == number
        carried = self.carried.expand(number, 1) if same else self.carried.new_zeros(number, 1)
        return carried if steps is None else carried * (steps[:, 0] > 1)

    def _with_values(self, batch: TensorDictBase) -> TensorDictBase:
        """Adds "encoded", "state_value" and ("next", "state_value") to a rollout (N, T), looking at each state once.

        A step's next state is the following step's state, but where an episode was truncated: that one, and the last
        of the rollout, are looked at themselves. What follows a terminated episode counts for nothing.
        """

        def value(encoded: Tensor) -> Tensor:
            return in_blocks(self.critic.module, encoded)

        encode, following = self.encoder.module, batch["next", "observation"]
        batch.set("encoded", encode(batch["observation"]))
        values = value(batch["encoded"])
        next_values = torch.cat([values[:, 1:], value(encode(following[:, -1:]))], dim=1)
        cut = (batch["next", "done"] & ~batch["next", "terminated"]).squeeze(-1)
        if bool(cut.any()):
            next_values[cut] = value(encode(following[cut]))
        return batch.set("state_value", values).set(("next", "state_value"), next_values)

    def _set_learning_rates(self, progress: float) -> None:
        if self.settings.linear_decay:
            share = max(1.0 - progress, 0.0)
            critic_rate = self.settings.critic_learning_rate or self.settings.learning_rate
            self.actor_rate = share * self.settings.learning_rate
            self.critic_optimizer.param_groups[0]["lr"] = share * critic_rate

    def state_dict(self) -> dict[str, Any]:
        """What the next update depends on, less the networks."""
        return {
            "actor_optimizer": self.actor_optimizer.state_dict(),
            "critic_optimizer": self.critic_optimizer.state_dict(),
            "generator": self.generator.get_state(),
            "updates": self.updates,
            "actor_steps": self.actor_steps,
            "carried": self.carried,
            "rate_share": self.rate_share,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """What `state_dict` gave. Without "carried" the returns so far stay, which belong to the simulations."""
        self.actor_optimizer.load_state_dict(state["actor_optimizer"])
        self.critic_optimizer.load_state_dict(state["critic_optimizer"])
        self.generator.set_state(state["generator"])
        self.updates, self.actor_steps = int(state["updates"]), int(state["actor_steps"])
        if "carried" in state:
            self.carried = state["carried"].to(self.device)
        self.rate_share = float(state.get("rate_share", 1.0))


def estimated_kl(mean_ratio: Tensor, mean_log: Tensor) -> Tensor:
    """The KL from the policy that acted to the policy as trained: the mean of r - 1 - ln r, from what a loss reports.

    It has the mean of -ln r and far less noise, and no term of it is negative.

    Args:
        mean_ratio: scalar, the mean of r = p(action as trained) / p(action when it was taken).
        mean_log: scalar, the mean of -ln r.

    Returns:
        Scalar of double precision, at least 0.

    Source: Schulman 2020, "Approximating KL divergence", k3.
    """
    return (mean_ratio.double() - 1.0 + mean_log.double()).clamp_min(0.0)  # rounding alone would be below


def adapted_share(share: float, kl: float, target: float) -> float:
    """Which share of the actor's rate the next update has, after one that ended with this KL; see `PPOSettings`."""
    factor = 1 / 1.5 if kl > 2 * target else 1.5 if kl < target / 2 else 1.0
    return min(max(share * factor, LEAST_SHARE), 1.0)


def _descend(
    loss: Tensor, learners: list[tuple[torch.optim.Optimizer, list[nn.Parameter]]], max_norm: float
) -> None:
    """One step of each optimiser, its parameters' gradient clipped to a norm of its own."""
    for optimizer, _ in learners:
        optimizer.zero_grad()
    loss.backward()
    for optimizer, parameters in learners:
        nn.utils.clip_grad_norm_(parameters, max_norm)
        optimizer.step()
