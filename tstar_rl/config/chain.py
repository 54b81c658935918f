"""From a checked config to the turns of a chain."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, fields
from functools import partial

from omegaconf import DictConfig
from torchrl.envs import TransformedEnv

from tstar_rl.chaining import turns
from tstar_rl.chaining.chain_settings import ChainSettings
from tstar_rl.chaining.chain_training import ChainTraining
from tstar_rl.chaining.gate import Gate, GateSettings
from tstar_rl.chaining.skill import Skill
from tstar_rl.chaining.trials import run_trial
from tstar_rl.chaining.turns import Turn
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.build import environment, make_collection, training_settings
from tstar_rl.config.check import ConfigError
from tstar_rl.config.demonstrations import given_demonstrations, load_demonstrations
from tstar_rl.config.ranges import chain_length, turn_shape
from tstar_rl.config.values import plain, settings
from tstar_rl.config.worlds import check_world
from tstar_rl.demonstrations.collect import collect
from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.models.network_settings import NetworkSettings
from tstar_rl.rollouts.collection import Collection
from tstar_rl.rollouts.ray_collection import RayCollection
from tstar_rl.rollouts.state_sets import TerminationSet
from tstar_rl.runs.mismatch import CheckpointMismatchError, differences
from tstar_rl.runs.run import Run
from tstar_rl.runs.run_folder import SKILLS_TOOK, run_path, spent_by_skills
from tstar_rl.seeds import derive_seed

__all__ = ["chain_run", "chain_turns", "check_links", "load_skills", "skills_as_they_are", "trial_env"]


def chain_turns(config: DictConfig, experts: Sequence[Demonstrations] | None = None) -> Iterator[Turn]:
    """The turns of config.chain, from the skills of the system config.skills; see `chaining.turns`.

    Args:
        config: of a recipe that trains a chain, which declares `from_checkpoint=str`.
        experts: demonstrations of each subtask; None: those that config.demonstrations names.

    Raises:
        CheckpointMismatchError: see `load_skills`.
        InvalidValueError: if the recipe does not declare from_checkpoint or it is null, or experts are not as many as
            the skills.
        DemonstrationError: see `given_demonstrations` and `load_demonstrations`.
    """
    if "from_checkpoint" not in config:
        raise InvalidValueError(
            "a recipe of a chain says which checkpoint of the skills it begins with: @rl.recipe(..., from_checkpoint="
            "str), and from_checkpoint: last in its file"
        )
    if config.from_checkpoint is None:
        raise InvalidValueError("from_checkpoint must be one of last, best; got None")
    skills = load_skills(config, checkpoint=config.from_checkpoint)
    if experts is None:
        experts = [load_demonstrations(config, index) for index in range(len(skills))]
    elif len(experts) != len(skills):
        raise InvalidValueError(
            f"a chain of {len(skills)} skills needs demonstrations of each, got {len(experts)}"
        )
    else:
        experts = [given_demonstrations(config, *each) for each in enumerate(experts)]
    values = config.chain
    rollouts, frames = turn_shape(config)
    run = chain_run(config, len(skills), values.rounds * len(skills) * rollouts * frames, trials=True)
    workshop = _Workshop(config)
    chain = ChainTraining(
        skills=skills,
        experts=experts,
        run=run,
        settings=ChainSettings(**{field.name: values[field.name] for field in fields(ChainSettings)}),
        rollouts=rollouts,
        training=training_settings(config, **values.ppo),
        workshop=workshop,
        record=run.origin,
        gate=Gate(
            GateSettings(values.gate, values.gate_margin, values.trial_every),
            lambda known, first: run_trial(skills, workshop.trial(), values.path_steps, known, first),
        ),
    )
    return turns.chain_turns(chain)


def chain_run(config: DictConfig, links: int, total: int = 0, trials: bool = False) -> Run:
    """The run of a recipe that makes a chain of trained skills: its config.yaml notes what the skills took.

    Args:
        config: of the recipe.
        links: how many skills the chain has.
        total, trials: see `Run`.
    """
    took = spent_by_skills(config.runs_dir, config.task.name, config.skills, config.seed, links)
    return Run(plain(config), None, total, trials=trials, notes={SKILLS_TOOK: took})


def _check_sizes(config: DictConfig, skill: Skill) -> None:
    built = {"networks": asdict(skill.settings), "chain": {"capacity": skill.initiation_set.capacity}}
    networks = asdict(settings(NetworkSettings, config.networks))
    wanted = {"networks": networks, "chain": {"capacity": config.chain.capacity}}
    wrong, values = differences(built, wanted), config.normalizer
    floor = None if values.running else skill.normalizer.floor_found()
    if floor is not None and not math.isclose(floor, values.floor, rel_tol=1e-5):
        wrong.append(f"normalizer.floor was {floor:.4g} when it was saved, and is {values.floor} now")
    if wrong:
        raise CheckpointMismatchError(
            f"skill {skill.subtask} of {config.skills}: {'; '.join(wrong)} (a chain keeps what its skills have)"
        )


class _Workshop:
    """`chaining.chain_training.Workshop` of a config. No evaluation has the seeds of its trials."""

    def __init__(self, config: DictConfig) -> None:
        self.config = config

    def turn_seed(self, turn: int) -> int:
        return derive_seed(self.config.seed, "chain", turn)

    def collection(
        self, skill: Skill, seed: int, before: TerminationSet | None
    ) -> Collection | RayCollection:
        return make_collection(
            self.config, skill.policy, skill.subtask, seed, before,
            snapshots=True, horizon=self.config.chain.horizon,
        )  # fmt: skip

    def demonstrations(
        self, subtask: int, before: TerminationSet, episodes: int, seed: int
    ) -> Demonstrations:
        values = self.config.demonstrations
        make = partial(
            environment, self.config, subtask, values.num_envs,
            before=before, snapshots=True, shares={"buffer": 1.0},
        )  # fmt: skip
        return collect(make, episodes, values.kind, values.noise, seed).to(self.config.device)

    def seeding_trial(self) -> TransformedEnv:
        return trial_env(self.config, self.config.chain.seed_episodes, "harvest")

    def trial(self) -> TransformedEnv:
        return trial_env(self.config, self.config.chain.trial_episodes, "validate")


def trial_env(config: DictConfig, episodes: int, purpose: str) -> TransformedEnv:
    """The whole task for one trial of a chain.

    Args:
        config: of a chain.
        episodes: simulations, one episode each.
        purpose: of `seeds.PURPOSES`; trials of one purpose begin alike.
    """
    seed = derive_seed(config.seed, purpose)
    return environment(config, None, episodes, seed, max_steps=config.chain.trial_max_steps)


def check_links(config: DictConfig, found: int) -> None:
    """Raises ConfigError if chain.links asks for another number of skills than the `found` ones of a chain."""
    if config.chain.links not in (None, found):
        raise ConfigError(
            f"chain.links is {config.chain.links}, and this chain has {found} skills: leave it out. It takes the first "
            "skills where these are chained as they are (system=no_finetuning_<name>), or a chain is trained"
        )


def load_skills(config: DictConfig, checkpoint: str = "last") -> list[Skill]:
    """The skills of the system config.skills that a chaining recipe starts from, in order.

    Raises:
        CheckpointMismatchError: if config.networks or config.chain.capacity are not what the skills have, nor
            config.normalizer.floor, where their normalisers tell it; or see `skills_as_they_are`.
    """
    skills = skills_as_they_are(config, checkpoint)
    for skill in skills:
        _check_sizes(config, skill)
    return skills


def skills_as_they_are(config: DictConfig, checkpoint: str = "last") -> list[Skill]:
    """The skills of the system config.skills, in order, whatever networks config has.

    Raises:
        CheckpointMismatchError: if one was trained in another world than config.env; see `check_world`.
    """
    skills = []
    for index in range(chain_length(config)):
        run = (config.task.name, config.skills, config.seed, index)
        folder = run_path(config.runs_dir, *run) / checkpoint
        check_world(config, folder, run_path(config.results_dir, *run))
        skills.append(Skill.load(folder, task=config.task.name, subtask=index).to(config.device))
    return skills
