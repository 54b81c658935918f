"""From a checked config to the objects of a run."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import torch
from omegaconf import DictConfig
from torch import nn
from torchrl.envs import TransformedEnv

from tstar_rl.chaining.skill import Skill
from tstar_rl.chaining.skill_training import SkillTraining
from tstar_rl.chaining.training import TrainingSettings
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.demonstrations import given_demonstrations, load_demonstrations
from tstar_rl.config.values import plain, settings
from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.demonstrations.starts import DemonstrationStarts
from tstar_rl.models.exploration import Exploration
from tstar_rl.models.network_settings import NetworkSettings
from tstar_rl.rollouts.cluster import ClusterSettings
from tstar_rl.rollouts.collection import Collection, with_starts
from tstar_rl.rollouts.ray_collection import RayCollection
from tstar_rl.rollouts.starts import make_starts
from tstar_rl.rollouts.state_sets import TerminationSet
from tstar_rl.runs import checkpoint
from tstar_rl.runs.mismatch import CHAINING
from tstar_rl.runs.run import Run
from tstar_rl.runs.saved_kinds import AN_AGENT, kind_of
from tstar_rl.seeds import derive_seed
from tstar_rl.spirl import LatentModelSettings, SpirlAgent
from tstar_rl.transforms.skill_chain_reset import Starts
from tstar_rl.updates import BehaviourCloningSettings, PPOSettings

__all__ = [
    "environment",
    "load_demonstrations",
    "load_skill",
    "make_collection",
    "new_skill",
    "new_spirl_agent",
    "skill_training",
    "training_settings",
]


def environment(
    config: DictConfig,
    subtask: int | None,
    num_envs: int,
    seed: int,
    before: TerminationSet | None = None,
    snapshots: bool = False,
    shares: Mapping[str, float] | None = None,
    starts: Starts | None = None,
    **overrides: Any,
) -> TransformedEnv:
    """The furniture environment of a config with the transforms of training.

    Args:
        config: its sections task and env are read, nthread, device and physics, and chain.starts or
            training.demonstration_starts, as below.
        subtask: 0-based; None is the whole task.
        num_envs: simulations N.
        seed: of start noise, and of the draws of starts.
        before: termination set of the skill before, if there is one: episodes then begin in the shares of
            chain.starts, or in `shares`.
        snapshots: whether each step has one.
        shares: of the sources of starts, by name.
        starts: without `before`: training.demonstration_starts of the episodes begin in states drawn from these.
        **overrides: settings of the task.

    Raises:
        InvalidValueError: if `starts` would never be drawn from.
    """
    if starts is not None and (before is not None or not config.training.demonstration_starts):
        share = config.training.demonstration_starts
        raise InvalidValueError(
            f"starts are drawn in training.demonstration_starts of the episodes where no skill is before; got {share}"
            + (" and a termination set as well" if before is not None else "")
        )
    from tstar_rl.env.furniture_env import FurnitureEnv

    values = {**plain(config.env), **overrides}
    where = {"nthread": config.nthread, "device": config.device, "physics": config.physics}
    env = FurnitureEnv(config.task.name, num_envs, subtask, seed=seed, snapshots=snapshots, **where, **values)
    if before is None:
        return with_starts(env, starts, config.training.demonstration_starts, seed, goes_on=True)
    return with_starts(env, *make_starts(shares or plain(config.chain.starts), env, before), seed)


def new_skill(config: DictConfig, subtask: int | None) -> Skill:
    """An untrained skill, its weights drawn with the run's seed.

    Raises:
        InvalidValueError: for networks.features of the whole task.
    """
    from tstar_rl.env.task_tables import observation_dim, subtask_geometry

    networks = settings(NetworkSettings, config.networks)
    features = None
    if networks.features:
        if subtask is None:
            raise InvalidValueError(
                "networks.features needs one subtask, subtask=<k>; for the whole task scale=whole, or "
                "networks.features=false"
            )
        features = subtask_geometry(config.task.name, subtask)
    torch.manual_seed(derive_seed(config.seed, "networks", subtask))
    name, capacity = config.task.name, config.chain.capacity
    skill = Skill(name, subtask, networks, features, capacity, observation_dim(name))
    return skill.to(config.device)


def new_spirl_agent(config: DictConfig, subtask: int | None) -> SpirlAgent:
    """An untrained agent of SPiRL, its weights drawn with the run's seed.

    Raises:
        InvalidValueError: for networks.features of the whole task.
    """
    from tstar_rl.env.task_tables import observation_dim, subtask_geometry

    geometry = None
    if config.networks.features:
        if subtask is None:
            raise InvalidValueError("networks.features of SPiRL needs one subtask: set subtask=0..")
        geometry = subtask_geometry(config.task.name, subtask)
    torch.manual_seed(derive_seed(config.seed, "networks", subtask))
    model, name = settings(LatentModelSettings, config.spirl.model), config.task.name
    return SpirlAgent(name, subtask, model, observation_dim(name), geometry).to(config.device)


def load_skill(path: str | Path, **expected: Any) -> Skill | SpirlAgent:
    """The skill or the SPiRL agent saved at `path`; raises what their `load` does."""
    record = checkpoint.read_record(path)
    if isinstance(record.get("built"), list):  # of all its policies
        raise InvalidValueError(
            f"{path} is a shipped chain: evaluate it with pretrained=<task>/<variant> pretrained_dir=..."
        )
    return (SpirlAgent if kind_of(record) == AN_AGENT else Skill).load(path, **expected)


def make_collection(
    config: DictConfig,
    policy: nn.Module,
    subtask: int | None,
    seed: int,
    before: TerminationSet | None = None,
    snapshots: bool = False,
    starts: Starts | None = None,
    horizon: int | None = None,
) -> Collection | RayCollection:
    """Rollouts for training, by collection.backend: "local", in this process, or "ray", by workers of a cluster.

    Args:
        config: its sections env, training, collection and cluster are read.
        policy: reads and writes TensorDicts.
        subtask: 0-based; None is the whole task.
        seed: of starts and, on a cluster, of actions.
        before: termination set of the skill before, if episodes begin in the shares of chain.starts.
        snapshots: whether each step has one.
        starts: see `environment`.
        horizon: steps of each simulation in one rollout; None: training.horizon.

    Raises:
        ValueError: if the backend is neither.
    """
    training, backend = config.training, config.collection.backend
    steps = horizon or training.horizon
    if backend not in ("local", "ray"):
        raise InvalidValueError(f"collection.backend must be local or ray, got {backend!r}")
    make = partial(
        environment, config, subtask, snapshots=snapshots, starts=starts, max_steps=training.max_steps
    )
    if backend == "local":
        return Collection(make(training.num_envs, seed, before), policy, steps)
    sizes = (training.num_envs, steps, config.collection.workers)
    return RayCollection(make, policy, *sizes, seed, before, settings(ClusterSettings, config.cluster))


def _demonstration_starts(config: DictConfig, expert: Demonstrations) -> DemonstrationStarts | None:
    training = config.training
    if training.demonstration_starts == 0:
        return None
    limit = training.max_steps * (config.task.subtasks if config.subtask is None else 1)
    return DemonstrationStarts(expert, limit, training.demonstration_steps)


def training_settings(config: DictConfig, **ppo: Any) -> TrainingSettings:
    """What is done to a skill in training; `ppo` are values that stand in the place of the section's."""
    exploration, normalizer = config.exploration, config.normalizer
    return TrainingSettings(
        ppo=settings(PPOSettings, {**config.ppo, **ppo}),
        exploration=None if exploration is None else settings(Exploration, exploration),
        running_normalizer=normalizer.running,
        normalizer_floor=normalizer.floor,
    )


def skill_training(
    config: DictConfig, expert: Demonstrations | None = None, starts: Starts | None = None
) -> SkillTraining:
    """The training of the skill of config.subtask, or of one policy of the whole task.

    Args:
        config: of a recipe that trains one policy.
        expert: demonstrations; None: those that config.demonstrations names.
        starts: what training.demonstration_starts of the episodes begin in, and go on from as their own episodes did
            (see goes_on of `SkillChainReset`); None: states of the demonstrations.
    """
    subtask, steps = config.subtask, config.training.total_steps
    seed = derive_seed(config.seed, "train", subtask)
    skill = new_skill(config, subtask)
    expert = (
        load_demonstrations(config, subtask)
        if expert is None
        else given_demonstrations(config, subtask, expert)
    )
    run = Run(plain(config), subtask, steps, unread=CHAINING)
    skill.normalizer.fit(expert.observations, config.normalizer.floor)

    def save(name: str, env_steps: int) -> None:
        skill.save(run.work / name, **run.origin, env_steps=env_steps)

    starts = _demonstration_starts(config, expert) if starts is None else starts
    collection = make_collection(config, skill.policy, subtask, seed, starts=starts)
    return SkillTraining(
        skill, expert, run, training_settings(config), collection, seed,
        warm_start=settings(BehaviourCloningSettings, config.bc) if config.warm_start else None,
        checkpoint_every=config.training.checkpoint_every,
        save=save,
    )  # fmt: skip
