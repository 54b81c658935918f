"""Which sections a config has, and what may stand in them.

`load.check_config` holds every config against this before a recipe begins. Hydra itself refuses an override of a key
that is not there; this is for what it lets through: keys added with `+` or in a file of one's own, and values of
another type. What the values mean is said in `configs/` and where they are read.

This imports no torch, so that a mistake in a plain value is told at once.
"""

from dataclasses import dataclass
from typing import Any

from tstar_rl.chaining.chain_settings import ChainSettings

__all__ = ["SECTIONS", "Config", "Section", "SpirlSection"]

SECTIONS = {
    "cluster": "rollouts.cluster.ClusterSettings",
    "networks": "chaining.skill.NetworkSettings",
    "exploration": "models.exploration.Exploration",
    "bc": "updates.BehaviourCloningSettings",
    "ppo": "updates.PPOSettings",
    "f_phi": "updates.DiscriminatorSettings",
    "d_omega": "updates.DiscriminatorSettings",
    "reward": "transforms.RewardMixture",
    "terminal_reward": "transforms.TerminalStateReward",
    "chain.ppo": "updates.PPOSettings",
    "feasibility": "updates.LabelledSettings",
    "proximity": "updates.LabelledSettings",
    "recovery": "chaining.recovery.RecoverySettings",
    "value_error": "updates.LabelledSettings",
    "spirl.model": "spirl.LatentModelSettings",
    "spirl.model_training": "spirl.ModelTrainingSettings",
    "spirl.policy": "spirl.LatentPolicySettings",
}
"""Sections whose names and types a class of the library declares, and where it is. A recipe need not have them all."""
Section = dict[str, Any]
"""One of `SECTIONS`. A recipe declares a section of its own as `name=rl.Section`, which imports no torch."""


@dataclass(frozen=True)
class TaskSection:
    """`configs/task`."""

    name: str
    subtasks: int
    laptop_steps: int
    """Environment steps of a skill's training at `scale=laptop`."""
    laptop_demonstrations: int
    """Episodes of a skill's demonstrations at `scale=laptop`."""


@dataclass(frozen=True)
class DemonstrationsSection:
    """How demonstrations are made, and which of them a recipe learns from."""

    episodes: int
    kind: str
    seed: int | None
    noise: float
    num_envs: int
    may_differ: tuple[str, ...]
    file: str | None
    observation_key: str | None
    filter_key: str | None


@dataclass(frozen=True)
class NormalizerSection:
    """Of observations."""

    running: bool
    floor: float


@dataclass(frozen=True)
class TrainingSection:
    """The budget of one policy."""

    num_envs: int
    horizon: int
    total_steps: int
    max_steps: int
    checkpoint_every: int
    demonstration_starts: float
    """Share of the episodes that begin in a state of the demonstrations, drawn uniformly."""
    demonstration_steps: int | None
    """Steps after which such an episode is truncated; None: at training.max_steps, with those that the
    demonstration had made by then."""


@dataclass(frozen=True)
class CollectionSection:
    """Where rollouts come from: see `config.build.make_collection`."""

    backend: str
    workers: int


@dataclass(frozen=True)
class ChainSection(ChainSettings):
    """Fine-tuning of a chain: what its turns read, and what they are made from."""

    links: int | None
    steps_per_turn: int
    horizon: int | None
    starts: dict[str, float]
    capacity: int
    trial_episodes: int
    trial_max_steps: int
    trial_every: int
    ppo: Section
    gate: bool
    gate_margin: float


@dataclass(frozen=True)
class EvaluationSection:
    """Episodes of one subtask and of the whole task, and how many of them are looked through for films; null: all."""

    episodes: int
    whole_episodes: int
    recorded: int | None


@dataclass(frozen=True)
class SpirlSection:
    """`configs/spirl`, of the recipe of that name."""

    model: Section
    model_training: Section
    policy: Section
    capacity: int
    num_envs: int
    max_steps: int
    total_steps: int
    checkpoint_every: int


@dataclass(frozen=True)
class Config:
    """What every recipe has; a recipe names the keys of its own when it is declared (`load.recipe`)."""

    system: str
    task: TaskSection
    seed: int
    subtask: int | None
    nthread: int
    torch_threads: int
    resume: bool
    results_dir: str
    runs_dir: str
    demonstrations_dir: str
    progress_bar: bool
    device: str
    physics: str | None
    collection: CollectionSection
    launch: str
    cluster: Section
    skills: str
    env: dict[str, Any]  # settings of the task, which the environment checks
    demonstrations: DemonstrationsSection
    warm_start: bool
    normalizer: NormalizerSection
    networks: Section
    exploration: Section | None
    bc: Section
    ppo: Section
    f_phi: Section
    d_omega: Section
    training: TrainingSection
    reward: Section
    terminal_reward: Section
    chain: ChainSection
    evaluation: EvaluationSection
