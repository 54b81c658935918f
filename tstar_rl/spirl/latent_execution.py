"""Acts with latents of H actions: as a transform of an environment, and as a policy that acts step by step."""

from collections.abc import Callable
from typing import cast

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import Tensor, nn
from torchrl.data import Composite, TensorSpec, Unbounded
from torchrl.envs import Transform
from torchrl.modules import ProbabilisticActor

from tstar_rl.transforms.reward_transform import taken_steps

__all__ = ["LatentExecution", "LatentPolicy"]

OUTCOME, BEGUN = "_outcome", "_begun"
"""Keys of the outcome of the steps so far, and of the state in which they began, while one latent is played."""


class LatentPolicy(TensorDictModuleBase):
    """Maps "observation" and "step_count" to "latent" and "action", one environment step at a time.

    The actor draws a new latent at every H-th step of an episode. The TensorDict carries the latent from step to step
    until then. Sampling follows TorchRL's `set_exploration_type`.

    Args:
        actor: "observation" -> "latent".
        decoder: latent, observation, step in 0 .. H-1 -> action.
        horizon: H.
    """

    def __init__(self, actor: ProbabilisticActor, decoder: nn.Module, horizon: int) -> None:
        super().__init__()
        self.in_keys, self.out_keys = ["observation", "step_count"], ["latent", "action"]
        self.actor, self.decoder, self.horizon = actor, decoder, horizon

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """tensordict: batch [N] -> the same with "latent" (N, Z) and "action" (N, 9)."""
        step = tensordict["step_count"].squeeze(-1) % self.horizon
        latent, drawn = tensordict.get("latent", None), self.actor(tensordict.select("observation"))["latent"]
        latent = drawn if latent is None else torch.where((step == 0).unsqueeze(-1), drawn, latent)
        action = self.decoder(latent, tensordict["observation"], step)
        return tensordict.set("latent", latent).set("action", action)


class LatentExecution(Transform):
    """Makes one step with a latent out of H steps of the environment.

    The transform decodes the latent into actions, takes the steps and sums their rewards. "next" is the state after H
    steps, or the state in which the episode ended before. A simulation that ended early goes on stepping with the
    others; those steps are dropped, though one that fails in them counts as a failure. "latent_steps" (*batch, 1)
    counts the steps of the episode that the latent took.

    Transforms appended before this one act at every environment step, those appended after it once per latent. It works
    in an environment only. TorchRL's `MultiAction` needs all actions before the first step; a closed-loop decoder needs
    each state first.

    Args:
        decoder: latent (..., Z), observation (..., O), step (...) int64 -> action (..., A).
        latent_dim: Z.
        horizon: H.
        latent_key: where the policy writes z.

    Raises:
        ValueError: if `horizon` is not positive.

    Source: SPiRL, algorithm 1.
    """

    def __init__(
        self,
        decoder: Callable[[Tensor, Tensor, Tensor], Tensor],
        latent_dim: int,
        horizon: int = 10,
        latent_key: str = "latent",
    ) -> None:
        if horizon < 1:
            raise ValueError(f"horizon must be at least 1, got {horizon}")
        super().__init__(in_keys_inv=["action"], out_keys_inv=[latent_key])
        self.__dict__["decoder"] = decoder  # not a submodule: its weights are not this transform's state
        self.latent_dim, self.horizon, self.latent_key = latent_dim, horizon, latent_key

    @torch.no_grad()
    def _inv_call(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Takes all steps but the last. TorchRL takes the last one with the "action" that this returns."""
        parent = self.parent
        if parent is None:
            return tensordict  # data on its way into a replay buffer
        latent, outcome, begun = tensordict.get(self.latent_key), None, tensordict
        for k in range(self.horizon):
            step = torch.full(tensordict.batch_size, k, device=latent.device)
            action = self.decoder(latent, tensordict.get("observation"), step)
            tensordict = tensordict.copy().set("action", action)
            if k < self.horizon - 1:
                tensordict = parent.step(tensordict)
                outcome = self._add_step(outcome, tensordict.get("next"))
                tensordict = parent.step_mdp(tensordict)
        return tensordict if outcome is None else tensordict.set(OUTCOME, outcome).set(BEGUN, begun)

    def _step(self, tensordict: TensorDictBase, next_tensordict: TensorDictBase) -> TensorDictBase:
        following = self._add_step(tensordict.get(OUTCOME, None), next_tensordict)
        if (taken := taken_steps(tensordict)) is not None:
            following.set("latent_steps", following.get("latent_steps") * taken.unsqueeze(-1))
        if (begun := tensordict.get(BEGUN, None)) is not None:
            tensordict.update(begun)  # for what comes after this transform the step began there
        return following

    def _add_step(self, outcome: TensorDictBase | None, following: TensorDictBase) -> TensorDictBase:
        """The outcome with one more step; rows whose episode has ended stay as they are."""
        following = following.copy()
        one = torch.ones_like(following.get("done"), dtype=torch.int64)
        if outcome is None:
            return following.set("latent_steps", one)
        ended = outcome.get("done")
        kept = outcome.select(*following.keys(True, True))
        merged = cast(TensorDictBase, torch.where(ended.squeeze(-1), kept, following))
        assert self.parent is not None
        for key in self.parent.reward_keys:
            merged.set(key, outcome.get(key) + following.get(key) * ~ended)
        return merged.set("latent_steps", outcome.get("latent_steps") + one * ~ended)

    def _reset(self, tensordict: TensorDictBase, tensordict_reset: TensorDictBase) -> TensorDictBase:
        shape = (*tensordict_reset.batch_size, 1)
        none = torch.zeros(shape, dtype=torch.int64, device=tensordict_reset.device)
        return tensordict_reset.set("latent_steps", none)

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Not supported.

        Raises:
            NotImplementedError: always.
        """
        raise NotImplementedError(
            "LatentExecution takes steps: append it to an environment, not to a replay buffer, a postproc or a model"
        )

    def transform_input_spec(self, input_spec: TensorSpec) -> TensorSpec:
        """Replaces the action by z, unbounded."""
        input_spec = cast(Composite, input_spec)
        actions = cast(Composite, input_spec["full_action_spec"])
        shape = torch.Size((*actions.shape, self.latent_dim))
        del actions["action"]
        actions[self.latent_key] = Unbounded(shape, device=actions.device)
        return input_spec

    def transform_observation_spec(self, observation_spec: TensorSpec) -> TensorSpec:
        """Adds "latent_steps"."""
        observation_spec = cast(Composite, observation_spec)
        shape = torch.Size((*observation_spec.shape, 1))
        observation_spec["latent_steps"] = Unbounded(shape, device=observation_spec.device, dtype=torch.int64)
        return observation_spec
