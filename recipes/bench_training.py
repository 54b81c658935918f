"""The part of the bench that learns: a warm start, and the loop of `gail_ppo.py` after it.

Of that loop it leaves out what costs next to nothing: a normaliser that runs on, and rates and noise that change with
progress.
"""

import time

from omegaconf import DictConfig

from tstar_rl.chaining.skill import Skill
from tstar_rl.config.build import environment, new_skill
from tstar_rl.config.values import settings
from tstar_rl.demonstrations.collect import collect
from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.rollouts.collection import Collection
from tstar_rl.transforms import GAILReward, RewardMixture, weighted
from tstar_rl.updates import (
    BehaviourCloningSettings,
    DiscriminatorSettings,
    DiscriminatorUpdate,
    PolicyUpdate,
    PPOSettings,
    behaviour_cloning,
)


def warm_started(config: DictConfig, seed: int) -> tuple[Skill, Demonstrations]:
    """A skill cloned from a few noise-injected demonstrations, so that it meets the contacts that training meets."""

    def make(s: int):
        return environment(config, config.subtask, 64, s, snapshots=True)

    expert = collect(make, 64, "noisy", config.demonstrations.noise, seed).to(config.device)
    return cloned(config, config.subtask, expert, seed), expert


def cloned(config: DictConfig, subtask: int, expert: Demonstrations, seed: int) -> Skill:
    """The skill of a subtask as its training begins."""
    skill = new_skill(config, subtask)
    skill.normalizer.fit(expert.observations, config.normalizer.floor)
    cloning = settings(BehaviourCloningSettings, config.bc)
    behaviour_cloning(skill.policy, expert.observations, expert.actions, cloning, seed)
    return skill


class Training:
    """GAIL+PPO end to end, one iteration at a time: the loop of `gail_ppo.py`."""

    def __init__(self, config: DictConfig, skill: Skill, expert: Demonstrations, env, seed: int) -> None:
        self.expert = expert
        labels, f_phi = {"expert": 1.0, "agent": -1.0}, settings(DiscriminatorSettings, config.f_phi)
        self.update_f_phi = DiscriminatorUpdate("f_phi", skill.f_phi, labels, f_phi, seed)
        ppo = settings(PPOSettings, config.ppo)
        self.update_policy = PolicyUpdate(skill.policy, skill.value, ppo, skill.return_scale, seed)
        self.reward = weighted(settings(RewardMixture, config.reward), {"gail": GAILReward(skill.f_phi)})
        self.world = env.base_env.world
        self.collection = Collection(env, skill.policy, config.training.horizon)

    def rate(self, iterations: int) -> float:
        """Control steps a second."""
        steps, began = 0, time.perf_counter()
        for _ in range(iterations):
            rollout = self.collection.rollout()
            steps += rollout.numel()
            self.update_f_phi(expert=self.expert.observations, agent=rollout["observation"])
            self.update_policy(self.reward(rollout), 0.0)
        return steps / (time.perf_counter() - began)
