"""Which sections a config has, and what may stand in them.

`load.check_config` holds every config against this before a recipe begins. Hydra itself refuses an override of a key
that is not there; this is for what it lets through: keys added with `+` or in a file of one's own, and values of
another type. Why a value is what it is, a comment beside it in `configs/` says.

This imports no torch, so that a mistake in a plain value is told at once.
"""

from dataclasses import dataclass
from typing import Any

from tstar_rl.chaining.chain_settings import ChainSettings

__all__ = ["SECTIONS", "Config", "Section", "SpirlSection"]

SECTIONS = {
    "cluster": "rollouts.cluster.ClusterSettings",
    "networks": "models.network_settings.NetworkSettings",
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
    """Successful episodes of each subtask, and of each kind."""
    kind: str
    """Which are learned from: `plain`, or `noisy`, in which noise was added to the expert's actions."""
    seed: int | None
    """Whose demonstrations are learned from; None: the run's own."""
    noise: float
    """Deviation of what is added to the arm's actions in noisy ones; 1 is full speed."""
    num_envs: int
    """Simulations that make them."""
    may_differ: tuple[str, ...]
    """Settings of the task that may be others than those that they were made with."""
    file: str | None
    """A file of one's own that is learned from instead, or a folder with one for each subtask: docs/data.md."""
    observation_key: str | None
    """Its array of observations, below `obs`; None: `flat`."""
    filter_key: str | None
    """Its list of the demonstrations to take, below `mask`; None: all."""


@dataclass(frozen=True)
class NormalizerSection:
    """Of observations."""

    running: bool
    """Whether mean and deviation go on with what is rolled out; else they are fitted once, to the demonstrations."""
    floor: float
    """The least deviation that an input is divided by."""


@dataclass(frozen=True)
class TrainingSection:
    """The budget of one policy."""

    num_envs: int
    """Simulations."""
    horizon: int
    """Control steps of each simulation in a rollout, after which the policy is updated."""
    total_steps: int
    """Environment steps, of all simulations together. A chain's are those of its turns: `chain`."""
    max_steps: int
    """Control steps after which an episode is truncated, for each subtask that it has."""
    checkpoint_every: int
    """Environment steps from one checkpoint to the next. A chain has one after every turn."""
    demonstration_starts: float
    """Share of the episodes that begin in a state of the demonstrations, drawn uniformly."""
    demonstration_steps: int | None
    """Steps after which such an episode is truncated; None: at training.max_steps, with those that the
    demonstration had made by then."""


@dataclass(frozen=True)
class CollectionSection:
    """Where rollouts come from: see `config.build.make_collection`."""

    backend: str
    """`local`: this process; `ray`: workers of a cluster."""
    workers: int
    """Of a cluster; each has its share of the simulations."""


@dataclass(frozen=True)
class ChainSection(ChainSettings):
    """Fine-tuning of a chain: what its turns read, and what they are made from."""

    links: int | None
    """Skills that are chained, from the first on; None: all."""
    steps_per_turn: int
    """Environment steps of a turn."""
    horizon: int | None
    """Control steps of each simulation in a rollout of a turn; None: those of `training`."""
    starts: dict[str, float]
    """Shares of a skill's episodes that begin in the environment, in draws from a Gaussian of the states in which the
    skill before ended, and in these states themselves (`buffer`)."""
    capacity: int
    """States that each set of a skill holds."""
    trial_episodes: int
    """Deterministic episodes of the whole chain in a trial, from the same starts every time."""
    trial_max_steps: int
    """Control steps after which such an episode is truncated, for each subtask."""
    trial_every: int
    """Turns from one trial to the next, where no gate asks for one after each."""
    ppo: Section
    """What PPO has otherwise than in `ppo`."""
    gate: bool
    """Whether a turn after which the chain does worse in the trial is put back."""
    gate_margin: float
    """By how much of its progress it may do worse and stay."""


@dataclass(frozen=True)
class EvaluationSection:
    """Fresh episodes of what was trained."""

    episodes: int
    """Of one subtask."""
    whole_episodes: int
    """Of the whole task."""
    recorded: int | None
    """How many are looked through for a success and a failure to film; None: all."""


@dataclass(frozen=True)
class SpirlSection:
    """`configs/spirl`, of the recipe of that name."""

    model: Section
    """Of the latents: `LatentModelSettings`."""
    model_training: Section
    """How it is fitted to the demonstrations: `ModelTrainingSettings`."""
    policy: Section
    """The policy over latents and its critics: `LatentPolicySettings`."""
    capacity: int
    """Latents in the replay buffer."""
    num_envs: int
    """Simulations."""
    max_steps: int
    """Control steps after which an episode is truncated, for each subtask that it has."""
    total_steps: int
    """Environment steps."""
    checkpoint_every: int
    """Environment steps from one checkpoint to the next."""


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
