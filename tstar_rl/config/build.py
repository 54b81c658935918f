"""From a checked config to the objects of a run."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import torch
from omegaconf import DictConfig
from torch import nn

from tstar_rl.chaining.skill import NetworkSettings, Skill
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.load import plain, settings
from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.demonstrations.file_check import KINDS, DemonstrationError
from tstar_rl.models.networks import set_action_std
from tstar_rl.rollouts.cluster import ClusterSettings
from tstar_rl.rollouts.collection import Collection, with_starts
from tstar_rl.rollouts.ray_collection import RayCollection
from tstar_rl.rollouts.starts import make_starts
from tstar_rl.rollouts.state_sets import TerminationSet
from tstar_rl.runs import checkpoint
from tstar_rl.runs.checkpoint import differences
from tstar_rl.runs.run_folder import run_path
from tstar_rl.seeds import derive_seed
from tstar_rl.spirl.agent import SkillAgent
from tstar_rl.spirl.skill_model import SkillModelSettings

__all__ = [
    "chain_length",
    "chain_trial_environment",
    "demonstrations_path",
    "environment",
    "explore",
    "load_demonstrations",
    "load_skill",
    "load_skills",
    "make_collection",
    "new_skill",
    "new_skill_agent",
    "trial_environment",
]


def environment(
    config: DictConfig,
    subtask: int | None,
    num_envs: int,
    seed: int,
    before: TerminationSet | None = None,
    snapshots: bool = False,
    shares: Mapping[str, float] | None = None,
    **overrides: Any,
) -> Any:
    """The furniture environment of a config with the transforms of training; overrides are settings of the task.

    `before` is the termination set of the skill before, if there is one: episodes then begin in the `shares` of
    chain.starts, or in those given.
    """
    from tstar_rl.env.furniture_env import FurnitureEnv

    values = {**plain(config.env), **overrides}
    where = {"nthread": config.nthread, "device": config.device, "physics": config.physics}
    env = FurnitureEnv(config.task.name, num_envs, subtask, seed=seed, snapshots=snapshots, **where, **values)
    if before is None:
        return with_starts(env)
    return with_starts(env, *make_starts(shares or plain(config.chain.starts), env, before), seed)


def trial_environment(config: DictConfig, skills: Sequence[Skill], trial: int, index: int) -> Any:
    """Where the skill of subtask `index` is tried: from where the chain before it arrives, and 20% its own starts.

    The seeds of each `trial` are its own, and no evaluation's.
    """
    chain, own = config.chain, config.chain.trial_environment_share
    return environment(
        config,
        index,
        chain.trial_episodes,
        derive_seed(config.seed, "validate", trial, index),
        skills[index - 1].termination_set if index else None,
        snapshots=True,
        shares={"environment": own, "buffer": 1.0 - own},
        max_steps=chain.trial_max_steps,
    )


def chain_trial_environment(config: DictConfig) -> Any:
    """Where the whole chain is tried, always from the same starts, to tell the best turn of a run.

    Their seed is no evaluation's, and no other trial's.
    """
    chain, seed = config.chain, derive_seed(config.seed, "validate", None, None)
    return environment(config, None, chain.whole_trial_episodes, seed, max_steps=chain.trial_max_steps)


def new_skill(config: DictConfig, subtask: int | None) -> Skill:
    """An untrained skill, its weights drawn with the run's seed."""
    from tstar_rl.env.furniture_env import observation_dim

    networks = settings(NetworkSettings, config.networks)
    features = None
    if networks.features:
        if subtask is None:
            raise InvalidValueError(
                "networks.features needs one subtask: set subtask=0.. or networks.features=false"
            )
        features = environment(config, subtask, 1, 0).base_env.features(subtask)
    torch.manual_seed(derive_seed(config.seed, "networks", subtask))
    name, capacity = config.task.name, config.chain.capacity
    skill = Skill(name, subtask, networks, features, capacity, observation_dim(name))
    return skill.to(config.device)


def new_skill_agent(config: DictConfig, subtask: int | None) -> SkillAgent:
    """An untrained agent of SPiRL, its weights drawn with the run's seed."""
    from tstar_rl.env.furniture_env import observation_dim

    geometry = None
    if config.networks.features:
        if subtask is None:
            raise InvalidValueError("networks.features of SPiRL needs one subtask: set subtask=0..")
        geometry = environment(config, subtask, 1, 0).base_env.features(subtask)
    torch.manual_seed(derive_seed(config.seed, "networks", subtask))
    model = settings(SkillModelSettings, config.spirl.model)
    name, hidden = config.task.name, tuple(config.spirl.critic_hidden)
    return SkillAgent(name, subtask, model, hidden, geometry, observation_dim(name)).to(config.device)


def demonstrations_path(config: DictConfig, subtask: int | None, kind: str) -> Path:
    """<demonstrations_dir>/<task>/<subtask<i>|whole>_<kind>.npz.

    Raises:
        ValueError: if `kind` is not one of `KINDS`.
    """
    if kind not in KINDS:
        raise InvalidValueError(f"kind of demonstrations must be one of {', '.join(KINDS)}; got {kind!r}")
    part = "whole" if subtask is None else f"subtask{subtask}"
    return Path(config.demonstrations_dir) / config.task.name / f"{part}_{kind}.npz"


def load_demonstrations(config: DictConfig, subtask: int | None) -> Demonstrations:
    """Those that the config's recipe learns from. A setting that their file does not name had its default."""
    from tstar_rl.env.furniture_env import DEFAULT_SETTINGS

    path = demonstrations_path(config, subtask, config.demonstrations.kind)
    found = Demonstrations.load(path, config.task.name, subtask)
    wanted = {k: v for k, v in plain(config.env).items() if k not in config.demonstrations.may_differ}
    saved = DEFAULT_SETTINGS | found.arguments
    wrong = differences({name: saved.get(name) for name in wanted}, wanted)
    if wrong:
        raise DemonstrationError(f"{path}: field arguments: {'; '.join(wrong)}; delete it to make it again")
    return found.to(config.device)


def chain_length(config: DictConfig) -> int:
    """How many skills are chained: chain.links, or all of the task's.

    Raises:
        ValueError: if there cannot be so many.
    """
    subtasks, links = config.task.subtasks, config.chain.links
    if links is not None and not 2 <= links <= subtasks:
        raise InvalidValueError(
            f"chain.links must be null or in 2..{subtasks} for {config.task.name}, got {links}"
        )
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


def explore(skill: Skill, config: DictConfig, progress: float) -> None:
    """Sets the deviation of exploration at `progress` in [0, 1], where it follows a schedule."""
    schedule = config.exploration
    if schedule is None or skill.settings.std != "fixed":
        return
    arm = schedule.arm[0] + progress * (schedule.arm[1] - schedule.arm[0])
    hand = schedule.hand[0] + progress * (schedule.hand[1] - schedule.hand[0])
    set_action_std(skill.policy, [arm] * 7 + [hand] * 2)


def load_skill(path: str | Path, **expected: Any) -> Skill | SkillAgent:
    """What a recipe saved at `path`, whichever of the two it is; raises what their `load` does."""
    built = checkpoint.read_record(path)["built"]
    return (SkillAgent if "critic_hidden" in built else Skill).load(path, **expected)


def make_collection(
    config: DictConfig,
    policy: nn.Module,
    subtask: int | None,
    seed: int,
    before: TerminationSet | None = None,
    snapshots: bool = False,
) -> Collection | RayCollection:
    """Rollouts for training, by collection.backend: "local", in this process, or "ray", by workers of a cluster.

    Args:
        config: its sections env, training, collection and cluster are read.
        policy: reads and writes TensorDicts.
        subtask: 0-based; None is the whole task.
        seed: of starts and, on a cluster, of actions.
        before: termination set of the skill before, if episodes begin in the shares of chain.starts.
        snapshots: whether each step has one.

    Raises:
        ValueError: if the backend is neither.
    """
    training, backend = config.training, config.collection.backend
    if backend not in ("local", "ray"):
        raise InvalidValueError(f"collection.backend must be local or ray, got {backend!r}")
    make = partial(environment, config, subtask, snapshots=snapshots, max_steps=training.max_steps)
    if backend == "local":
        return Collection(make(training.num_envs, seed, before), policy, training.horizon)
    sizes = (training.num_envs, training.horizon, config.collection.workers)
    return RayCollection(make, policy, *sizes, seed, before, settings(ClusterSettings, config.cluster))
