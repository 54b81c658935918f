"""Which sections a config has, and what may stand in them.

`configuration.check_config` holds every config against this before a recipe begins. Hydra itself refuses an override of
a key that is not there; this is for what it lets through: keys added with `+` or in a file of one's own, and values of
another type. What the values mean is said in `configs/` and where they are read.
"""

from dataclasses import dataclass
from typing import Any, Literal

from tstar_rl.chaining.skill import NetworkSettings
from tstar_rl.models.exploration import Exploration
from tstar_rl.rollouts.cluster import ClusterSettings
from tstar_rl.spirl import LatentModelSettings, LatentPolicySettings, ModelTrainingSettings
from tstar_rl.transforms import RewardMixture, TerminalStateReward
from tstar_rl.updates import BehaviourCloningSettings, DiscriminatorSettings, PPOSettings

__all__ = ["Config", "SpirlSection"]


@dataclass(frozen=True)
class TaskSection:
    """`configs/task`."""

    name: str
    subtasks: int
    laptop_steps: int
    """Environment steps of a skill's training at `scale=laptop`."""


@dataclass(frozen=True)
class DemonstrationsSection:
    """How demonstrations are made, and which of them a recipe learns from."""

    episodes: int
    kind: str
    seed: int | None
    noise: float
    num_envs: int
    may_differ: tuple[str, ...]


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
    """Steps after which such an episode is truncated; None: after those that the demonstration's own had left."""


@dataclass(frozen=True)
class CollectionSection:
    """Where rollouts come from: see `backends`."""

    backend: str
    workers: int


@dataclass(frozen=True)
class ChainSection:
    """Fine-tuning of a chain."""

    links: int | None
    rounds: int
    steps_per_turn: int
    starts: dict[str, float]
    capacity: int
    seed_episodes: int
    kept_states: Literal["all", "chained"]
    d_omega_of: Literal["next", "own"]
    carry_over: bool
    trial_episodes: int
    trial_max_steps: int
    trial_every: int
    logged_skill: int
    logged_states: int
    ppo: PPOSettings
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

    model: LatentModelSettings
    model_training: ModelTrainingSettings
    policy: LatentPolicySettings
    capacity: int
    num_envs: int
    max_steps: int
    total_steps: int
    checkpoint_every: int


@dataclass(frozen=True)
class Config:
    """What every recipe has; a recipe names the keys of its own when it is declared (`configuration.recipe`)."""

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
    cluster: ClusterSettings
    skills: str
    env: dict[str, Any]  # settings of the task, which the environment checks
    demonstrations: DemonstrationsSection
    warm_start: bool
    normalizer: NormalizerSection
    networks: NetworkSettings
    exploration: Exploration | None
    bc: BehaviourCloningSettings
    ppo: PPOSettings
    f_phi: DiscriminatorSettings
    d_omega: DiscriminatorSettings
    training: TrainingSection
    reward: RewardMixture
    terminal_reward: TerminalStateReward
    chain: ChainSection
    evaluation: EvaluationSection
