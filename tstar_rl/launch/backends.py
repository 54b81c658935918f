"""Where rollouts are made and recipes run, as a config says: in this process and beside it, or on a Ray cluster."""

from collections.abc import Callable
from functools import partial

from omegaconf import DictConfig

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.values import settings
from tstar_rl.launch.cluster import run_on_cluster
from tstar_rl.launch.side_by_side import run_recipe
from tstar_rl.rollouts.cluster import ClusterSettings

__all__ = ["check_local", "launcher"]


def launcher(config: DictConfig) -> Callable[..., None]:
    """What runs a recipe for another one, by launch: "local", a process here, or "ray", a task of a cluster.

    A cluster of this machine's own has room for them all, and for the workers of each with collection.backend=ray.
    """
    if config.launch == "local":
        return run_recipe
    workers = config.collection.workers if config.collection.backend == "ray" else 0
    cluster = settings(ClusterSettings, config.cluster)
    return partial(run_on_cluster, cluster, config.processes * (1 + workers))


def check_local(launch: str, recipe: str) -> None:
    """Raises InvalidValueError unless launch is local, for a recipe that sends none of its steps to a cluster."""
    if launch != "local":
        raise InvalidValueError(f"{recipe} runs its recipes here: launch must be local, got {launch}")
