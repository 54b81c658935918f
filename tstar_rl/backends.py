"""Where rollouts are made and recipes run, as a config says: in this process and beside it, or on a Ray cluster."""

from collections.abc import Callable
from functools import partial

from omegaconf import DictConfig
from torch import nn

from tstar_rl.cluster import ClusterSettings, run_on_cluster
from tstar_rl.collection import Collection
from tstar_rl.configuration import environment, settings
from tstar_rl.ray_collection import RayCollection
from tstar_rl.side_by_side import run_recipe
from tstar_rl.state_sets import TerminationSet

__all__ = ["launcher", "make_collection"]


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
        raise ValueError(f"collection.backend must be local or ray, got {backend!r}")
    make = partial(environment, config, subtask, snapshots=snapshots, max_steps=training.max_steps)
    if backend == "local":
        return Collection(make(training.num_envs, seed, before), policy, training.horizon)
    sizes = (training.num_envs, training.horizon, config.collection.workers)
    return RayCollection(make, policy, *sizes, seed, before, settings(ClusterSettings, config.cluster))


def launcher(config: DictConfig) -> Callable[..., None]:
    """What runs a recipe for another one, by launch: "local", a process here, or "ray", a task of a cluster.

    Raises:
        ValueError: if it is neither.
    """
    if config.launch not in ("local", "ray"):
        raise ValueError(f"launch must be local or ray, got {config.launch!r}")
    cluster = settings(ClusterSettings, config.cluster)
    return run_recipe if config.launch == "local" else partial(run_on_cluster, cluster, config.processes)
