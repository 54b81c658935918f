"""Acts with skills of H actions: one step outside is H steps inside."""

from collections.abc import Callable
from typing import cast

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.data import Composite, TensorSpec, Unbounded
from torchrl.envs import Transform

PLAYED = "_played"


class SkillExecution(Transform):
    """Decodes a skill z into H actions, steps the environment with them and sums the rewards.

    What it returns below "next" is the state after H steps, or the one in which the episode ended on the way: what a
    simulation does after its end, while others go on, is dropped. It writes "skill_steps" (*batch, 1), the steps of the
    episode that the skill took. Transforms appended before this one are called at every step, those after it once a
    skill. It works in an environment only.

    TorchRL's `MultiAction` is its like, but takes all actions before the first step, where a closed-loop decoder wants
    each state, and leaves it to an environment that steps as a batch to stand still where it has ended.

    Args:
        decoder: skill (..., Z), observation (..., O), step (...) int64 -> action (..., A).
        latent: Z.
        horizon: H.
        skill_key: where the policy writes z.

    Raises:
        ValueError: if `horizon` is not positive.

    Source: SPiRL, algorithm 1.
    """

    def __init__(
        self,
        decoder: Callable[[Tensor, Tensor, Tensor], Tensor],
        latent: int,
        horizon: int = 10,
        skill_key: str = "skill",
    ) -> None:
        if horizon < 1:
            raise ValueError(f"horizon must be at least 1, got {horizon}")
        super().__init__(in_keys_inv=["action"], out_keys_inv=[skill_key])
        self.__dict__["decoder"] = decoder  # read by handle: its weights are not this transform's state
        self.latent, self.horizon, self.skill_key = latent, horizon, skill_key

    @torch.no_grad()
    def _inv_call(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Takes all steps but the last, which is TorchRL's to take with the "action" that this leaves."""
        parent = self.parent
        if parent is None:
            return tensordict  # a replay buffer's way in
        skill, played = tensordict.get(self.skill_key), None
        for k in range(self.horizon):
            step = torch.full(tensordict.batch_size, k, device=skill.device)
            action = self.decoder(skill, tensordict.get("observation"), step)
            tensordict = tensordict.copy().set("action", action)
            if k < self.horizon - 1:
                tensordict = parent.step(tensordict)
                played = self._go_on(played, tensordict.get("next"))
                tensordict = parent.step_mdp(tensordict)
        return tensordict if played is None else tensordict.set(PLAYED, played)

    def _step(self, tensordict: TensorDictBase, next_tensordict: TensorDictBase) -> TensorDictBase:
        return self._go_on(tensordict.get(PLAYED, None), next_tensordict)

    def _go_on(self, played: TensorDictBase | None, following: TensorDictBase) -> TensorDictBase:
        """The outcome of the steps so far: `played` where the episode has ended, else `following`."""
        following = following.copy()
        one = torch.ones_like(following.get("done"), dtype=torch.int64)
        if played is None:
            return following.set("skill_steps", one)
        ended = played.get("done")
        kept = played.select(*following.keys(True, True))
        outcome = cast(TensorDictBase, torch.where(ended.squeeze(-1), kept, following))
        assert self.parent is not None
        for key in self.parent.reward_keys:
            outcome.set(key, played.get(key) + following.get(key) * ~ended)
        return outcome.set("skill_steps", played.get("skill_steps") + one * ~ended)

    def _reset(self, tensordict: TensorDictBase, tensordict_reset: TensorDictBase) -> TensorDictBase:
        none = torch.zeros(
            (*tensordict_reset.batch_size, 1), dtype=torch.int64, device=tensordict_reset.device
        )
        return tensordict_reset.set("skill_steps", none)

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Not supported.

        Raises:
            NotImplementedError: always.
        """
        raise NotImplementedError(
            "SkillExecution steps: append it to an environment, not to a replay buffer, a postproc or a model"
        )

    def transform_input_spec(self, input_spec: TensorSpec) -> TensorSpec:
        """z in the place of the action, unbounded."""
        input_spec = cast(Composite, input_spec)
        actions = cast(Composite, input_spec["full_action_spec"])
        shape = torch.Size((*actions.shape, self.latent))
        del actions["action"]
        actions[self.skill_key] = Unbounded(shape, device=actions.device)
        return input_spec

    def transform_observation_spec(self, observation_spec: TensorSpec) -> TensorSpec:
        """Adds "skill_steps"."""
        observation_spec = cast(Composite, observation_spec)
        shape = torch.Size((*observation_spec.shape, 1))
        observation_spec["skill_steps"] = Unbounded(shape, device=observation_spec.device, dtype=torch.int64)
        return observation_spec
