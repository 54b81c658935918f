"""From a checked config to the turns of a chain."""

from collections.abc import Iterator, Sequence

from omegaconf import DictConfig
from torchrl.envs import TransformedEnv

from tstar_rl.chaining import turns
from tstar_rl.chaining.gate import GateSettings
from tstar_rl.chaining.skill import Skill
from tstar_rl.chaining.turns import ChainSettings, Turn
from tstar_rl.config.build import environment, load_demonstrations, make_collection, training_settings
from tstar_rl.config.load import plain
from tstar_rl.rollouts.collection import Collection
from tstar_rl.rollouts.ray_collection import RayCollection
from tstar_rl.rollouts.state_sets import TerminationSet
from tstar_rl.runs.run import Run
from tstar_rl.runs.run_folder import run_path
from tstar_rl.seeds import derive_seed

__all__ = ["chain_length", "chain_turns", "load_skills"]


def chain_turns(config: DictConfig) -> Iterator[Turn]:
    """The turns of config.chain, from the skills of the system config.skills; see `chaining.turns`."""
    skills = load_skills(config, checkpoint=config.from_checkpoint)
    experts = [load_demonstrations(config, index) for index in range(len(skills))]
    chain, frames = config.chain, config.training.num_envs * config.training.horizon
    settings = ChainSettings(
        rounds=chain.rounds,
        rollouts=max(chain.steps_per_turn // frames, 1),
        frames=frames,
        logged_skill=chain.logged_skill,
        logged_states=chain.logged_states,
    )
    total = settings.rounds * len(skills) * settings.rollouts * frames
    run = Run(plain(config), None, total, trials=True)
    gate = GateSettings(chain.gate, chain.gate_margin, chain.whole_trial_every)
    training = training_settings(config, **chain.ppo)
    return turns.chain_turns(
        skills, experts, run, settings, training, gate, _Workshop(config), recipe=config.system
    )


class _Workshop:
    """`chaining.turns.Workshop` of a config."""

    def __init__(self, config: DictConfig) -> None:
        self.config = config

    def turn_seed(self, turn: int) -> int:
        return derive_seed(self.config.seed, "train", turn)

    def collection(
        self, skill: Skill, seed: int, before: TerminationSet | None
    ) -> Collection | RayCollection:
        return make_collection(self.config, skill.policy, skill.subtask, seed, before, snapshots=True)

    def skill_trial(self, skills: Sequence[Skill], trial: int, index: int) -> TransformedEnv:
        """From where the chain before ends, and a share of the skill's own starts; no evaluation has its seeds."""
        chain, own = self.config.chain, self.config.chain.trial_environment_share
        return environment(
            self.config,
            index,
            chain.trial_episodes,
            derive_seed(self.config.seed, "validate", trial, index),
            skills[index - 1].termination_set if index else None,
            snapshots=True,
            shares={"environment": own, "buffer": 1.0 - own},
            max_steps=chain.trial_max_steps,
        )

    def chain_trial(self) -> TransformedEnv:
        """The whole task, always from the same starts; no evaluation and no other trial has their seed."""
        chain, seed = self.config.chain, derive_seed(self.config.seed, "validate", None, None)
        return environment(
            self.config, None, chain.whole_trial_episodes, seed, max_steps=chain.trial_max_steps
        )


def chain_length(config: DictConfig) -> int:
    """How many skills are chained: chain.links, or all of the task's.

    Raises:
        ValueError: if there cannot be so many.
    """
    subtasks, links = config.task.subtasks, config.chain.links
    if links is not None and not 2 <= links <= subtasks:
        raise ValueError(f"chain.links must be null or in 2..{subtasks} for {config.task.name}, got {links}")
    return links or subtasks


def load_skills(config: DictConfig, checkpoint: str = "last") -> list[Skill]:
    """The skills of the system config.skills that a chaining recipe starts from, in order."""
    return [
        Skill.load(
            run_path(config.runs_dir, config.task.name, config.skills, config.seed, index) / checkpoint,
            task=config.task.name,
            subtask=index,
        ).to(config.device)
        for index in range(chain_length(config))
    ]
