"""What SPiRL learns of a task: the skill model, and the policy that chooses among its skills."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from tensordict import TensorDictBase
from tensordict.nn import TensorDictModuleBase
from torch import nn
from torchrl.modules import ProbabilisticActor

from tstar_rl.env.layout import FIVE_PARTS
from tstar_rl.models.normalizer import Normalizer
from tstar_rl.models.relative_features import RelativeFeatures
from tstar_rl.models.state_input import StateInput
from tstar_rl.runs import checkpoint
from tstar_rl.spirl.skill_model import (
    SkillCritic,
    SkillModel,
    SkillModelSettings,
    SkillPrior,
    make_skill_actor,
    make_skill_critic,
)

__all__ = ["SkillAgent", "SkillPolicy"]


class SkillPolicy(TensorDictModuleBase):
    """One step at a time: map from "observation", "step_count" to "skill", "action".

    Every H steps of an episode the actor chooses a skill; it stays in the TensorDict, from step to step, until the next
    choice. Sampling follows TorchRL's `set_exploration_type`.

    Args:
        actor: "observation" -> "skill".
        decoder: skill, observation, step in 0 .. H-1 -> action.
        horizon: H.
    """

    def __init__(self, actor: ProbabilisticActor, decoder: nn.Module, horizon: int) -> None:
        super().__init__()
        self.in_keys, self.out_keys = ["observation", "step_count"], ["skill", "action"]
        self.actor, self.decoder, self.horizon = actor, decoder, horizon

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """tensordict: batch [N] -> the same with "skill" (N, Z) and "action" (N, 9)."""
        step = tensordict["step_count"].squeeze(-1) % self.horizon
        skill, chosen = tensordict.get("skill", None), self.actor(tensordict.select("observation"))["skill"]
        skill = chosen if skill is None else torch.where((step == 0).unsqueeze(-1), chosen, skill)
        action = self.decoder(skill, tensordict["observation"], step)
        return tensordict.set("skill", skill).set("action", action)


class SkillAgent:
    """Skill model, actor and critic of one task or subtask.

    The critic is an image: `SkillPolicyUpdate` makes those that it trains after it, and keeps them. It is not saved.

    Args:
        task: furniture.
        subtask: 0-based; None for the whole task.
        settings: of the skill model.
        critic_hidden: sizes of the critic.
        geometry: what `FurnitureEnv.features(subtask)` gives, if the networks are to see `RelativeFeatures`.
        obs_dim: numbers in an observation of the task, `features.observation_size` of its parts.
    """

    def __init__(
        self,
        task: str,
        subtask: int | None,
        settings: SkillModelSettings,
        critic_hidden: tuple[int, ...] = (256, 256),
        geometry: dict[str, Any] | None = None,
        obs_dim: int = FIVE_PARTS,
    ) -> None:
        self.task, self.subtask, self.settings = task, subtask, settings
        self.critic_hidden, self.geometry, self.obs_dim = critic_hidden, geometry, obs_dim
        self.normalizer = Normalizer(obs_dim)
        features = RelativeFeatures(geometry) if geometry is not None else None
        state = StateInput(obs_dim, self.normalizer, features)
        self.model = SkillModel(settings, state)
        self.network = SkillPrior(settings, state)
        self.actor = make_skill_actor(self.network)
        self.critic = make_skill_critic(SkillCritic(settings, critic_hidden, state))
        self.policy = SkillPolicy(self.actor, self.model.decoder, settings.horizon)

    def start_from_prior(self) -> None:
        """Makes the policy equal to the prior. Source: SPiRL's appendix."""
        self.network.load_state_dict(self.model.prior.state_dict())

    def to(self, device: torch.device | str) -> "SkillAgent":
        """Moves the networks to a device, in place."""
        for module in (self.model, self.network, self.critic):
            module.to(device)
        return self

    def state_dict(self) -> dict[str, Any]:
        """Skill model and actor, with the normaliser inside."""
        return {"model": dict(self.model.state_dict()), "network": dict(self.network.state_dict())}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """What `state_dict` gave; an untrained critic, which agents used to save beside it, is left aside."""
        self.model.load_state_dict(state["model"])
        self.network.load_state_dict(state["network"])

    def save(self, path: str | Path, **record: Any) -> None:
        """Writes the agent, and beside it plain values that say what it is."""
        built = {
            "settings": asdict(self.settings),
            "critic_hidden": list(self.critic_hidden),
            "geometry": checkpoint.to_plain(self.geometry),
            "obs_dim": self.obs_dim,
        }
        record = {"task": self.task, "subtask": self.subtask, "built": built, **record}
        checkpoint.save(path, {"agent": self}, record)

    @classmethod
    def load(cls, path: str | Path, **expected: Any) -> "SkillAgent":
        """Builds the agent saved at `path`.

        Raises:
            FileNotFoundError: if there is none.
            CheckpointMismatchError: if what is `expected` (task=..., subtask=...) is not what it was saved with.
        """
        record = checkpoint.read_record(path, **expected)
        built = record["built"]
        agent = cls(
            record["task"],
            record["subtask"],
            SkillModelSettings(**checkpoint.to_tuples(built["settings"])),
            tuple(built["critic_hidden"]),
            checkpoint.to_tensors(built["geometry"]),
            built.get("obs_dim", FIVE_PARTS),
        )
        checkpoint.load(path, {"agent": agent}, **expected)
        return agent
