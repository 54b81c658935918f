"""From the values in `configs/` to the objects of a run. The one file that knows how the sections are called."""

import logging
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import hydra
import torch
from omegaconf import DictConfig, OmegaConf

from tstar_rl.checkpoint import differences
from tstar_rl.collection import derive_seed, with_starts
from tstar_rl.config_check import check
from tstar_rl.config_schema import Config
from tstar_rl.demonstrations import KINDS, DemonstrationError, Demonstrations
from tstar_rl.logging import run_path
from tstar_rl.networks import set_action_std
from tstar_rl.skill import NetworkSettings, Skill
from tstar_rl.skill_agent import SkillAgent
from tstar_rl.skill_prior import SkillModelSettings
from tstar_rl.starts import make_starts
from tstar_rl.state_sets import TerminationSet

__all__ = [
    "chain_length",
    "chain_trial_environment",
    "check_config",
    "demonstrations_path",
    "environment",
    "explore",
    "load_demonstrations",
    "load_skills",
    "new_skill",
    "new_skill_agent",
    "plain",
    "recipe",
    "settings",
    "trial_environment",
]

CONFIGS = Path(__file__).resolve().parent.parent / "configs"
OWN_KEYS: dict[str, dict[str, Any]] = {}
"""Of each recipe that was imported, the keys that no other recipe needs to have, and the types of their values."""


def recipe(name: str, **own: Any) -> Callable[[Callable[[DictConfig], None]], Callable[[], None]]:
    """Makes a function of the config into the main function of a recipe: one torch thread, values from `configs/`.

    Args:
        name: of its file in `configs/recipe`.
        **own: keys of that file which `config_schema.Config` does not have, and the types of their values.
    """
    OWN_KEYS[name] = own

    def decorate(function: Callable[[DictConfig], None]) -> Callable[[], None]:
        def main(config: DictConfig) -> None:
            check_config(config, name)
            torch.set_num_threads(config.torch_threads)
            logging.getLogger("torchrl").setLevel(logging.WARNING)
            function(config)

        return hydra.main(version_base="1.3", config_path=str(CONFIGS), config_name=f"recipe/{name}")(main)

    return decorate


def plain(config: DictConfig) -> dict[str, Any]:
    """The config as nested plain values."""
    return OmegaConf.to_container(config, resolve=True, throw_on_missing=True)  # type: ignore[return-value]


def check_config(config: DictConfig, name: str) -> None:
    """Checks all names and types in the config of the recipe `name`.

    Raises:
        ConfigError: see `config_check.check`.
        ValueError: for a task that there is not or has not so many subtasks, and for settings of it that there are
            not or have no such value.
    """
    from tstar_rl.furniture_env import check_task

    values = plain(config)
    check(values, Config, "", OWN_KEYS[name])
    check_task(config.task.name, config.task.subtasks, values["env"])


def settings(kind: type, section: Mapping[str, Any] | DictConfig) -> Any:
    """A frozen settings object from a section of the config.

    Raises:
        ConfigError: for a name that `kind` does not have, or a value of another type.
    """
    values = (
        OmegaConf.to_container(section, resolve=True) if isinstance(section, DictConfig) else dict(section)
    )
    assert isinstance(values, dict)
    check({str(name): value for name, value in values.items()}, kind, kind.__name__)
    return kind(**{str(k): tuple(v) if isinstance(v, list) else v for k, v in values.items()})


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
    from tstar_rl.furniture_env import FurnitureEnv

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
    from tstar_rl.furniture_env import observation_dim

    networks = settings(NetworkSettings, config.networks)
    features = None
    if networks.features:
        if subtask is None:
            raise ValueError(
                "networks.features needs one subtask: set subtask=0.. or networks.features=false"
            )
        features = environment(config, subtask, 1, 0).base_env.features(subtask)
    torch.manual_seed(derive_seed(config.seed, "networks", subtask))
    name, capacity = config.task.name, config.chain.capacity
    skill = Skill(name, subtask, networks, features, capacity, observation_dim(name))
    return skill.to(config.device)


def new_skill_agent(config: DictConfig, subtask: int | None) -> SkillAgent:
    """An untrained agent of SPiRL, its weights drawn with the run's seed."""
    from tstar_rl.furniture_env import observation_dim

    geometry = None
    if config.networks.features:
        if subtask is None:
            raise ValueError("networks.features of SPiRL needs one subtask: set subtask=0..")
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
        raise ValueError(f"kind of demonstrations must be one of {', '.join(KINDS)}; got {kind!r}")
    part = "whole" if subtask is None else f"subtask{subtask}"
    return Path(config.demonstrations_dir) / config.task.name / f"{part}_{kind}.npz"


def load_demonstrations(config: DictConfig, subtask: int | None) -> Demonstrations:
    """Those that the config's recipe learns from. A setting that their file does not name had its default."""
    from tstar_rl.furniture_env import DEFAULT_SETTINGS

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


def explore(skill: Skill, config: DictConfig, progress: float) -> None:
    """Sets the deviation of exploration at `progress` in [0, 1], where it follows a schedule."""
    schedule = config.exploration
    if schedule is None or skill.settings.std != "fixed":
        return
    arm = schedule.arm[0] + progress * (schedule.arm[1] - schedule.arm[0])
    hand = schedule.hand[0] + progress * (schedule.hand[1] - schedule.hand[0])
    set_action_std(skill.policy, [arm] * 7 + [hand] * 2)
