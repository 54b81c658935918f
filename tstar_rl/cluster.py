"""A Ray cluster: one that is there already, or one of this machine's own; and recipes run as tasks of it."""

import os
import runpy
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from tstar_rl.side_by_side import RECIPES, Step

__all__ = ["ClusterSettings", "connect", "resources", "run_on_cluster"]

RETRIES = 5
"""Times that a worker, or a recipe's process, is replaced before its death is the run's."""


@dataclass(frozen=True)
class ClusterSettings:
    """Where the cluster is, and what one worker or one recipe takes of it."""

    address: str | None = None
    """None: the environment's RAY_ADDRESS, or without it a cluster of this machine's own, gone with the process."""
    cpus: float = 1
    gpus: float = 0


def connect(settings: ClusterSettings, workers: int) -> Any:
    """The `ray` module, connected; a cluster of this machine's own has room for `workers`.

    Raises:
        ImportError: if Ray is not installed, with the command that does it.
    """
    try:
        import ray
    except ImportError as error:
        raise ImportError(
            "collection.backend=ray and launch=ray need Ray, which is not installed: "
            "python -m pip install -e '.[ray]' in the repository, or 'tstar_rl[ray]'"
        ) from error
    if not ray.is_initialized():
        address = settings.address or os.environ.get("RAY_ADDRESS")
        cpus = max(os.cpu_count() or 1, round(workers * settings.cpus))
        own: dict[str, Any] = {} if address else {"num_cpus": cpus, "include_dashboard": False}
        ray.init(address=address, logging_level="WARNING", **own)
    return ray


def resources(settings: ClusterSettings) -> dict[str, float]:
    """What Ray keeps free for one worker or one recipe."""
    return {"num_cpus": settings.cpus, "num_gpus": settings.gpus}


def _recipe(script: str, values: Sequence[str], folder: str) -> str | None:
    """Runs a recipe in this process, which ends with it; returns what it said if it stopped early."""
    os.chdir(folder)
    sys.argv = [script, *values]
    try:
        runpy.run_path(script, run_name="__main__")
    except SystemExit as stop:  # Ray would take it for a worker that left
        return str(stop.code) if stop.code else None
    return None


def run_on_cluster(
    settings: ClusterSettings, workers: int, step: Step, shared: Sequence[str] = (), line: int = 0
) -> None:
    """As `side_by_side.run_recipe`, on whichever node has room. A node that dies is replaced by another.

    The step's process is the task's, so that nothing of it outlives a worker that was killed; what takes its place
    goes on from the step's last checkpoint. The repository, demonstrations, runs and results lie where every node
    finds them under the same path.

    Raises:
        SystemExit: if it fails, with its command.
    """
    ray = connect(settings, workers)
    name, *own = step
    values = [*shared, *own, "progress_bar=false"]  # bars of several nodes on one screen cannot be read
    script = str(RECIPES / f"{name}.py")
    remote = ray.remote(max_calls=1, max_retries=RETRIES, **resources(settings))(_recipe)
    command = f"{script} {' '.join(values)}"
    try:
        said = ray.get(remote.options(name=f"{name} {' '.join(own)}").remote(script, values, os.getcwd()))
    except ray.exceptions.RayError as error:
        raise SystemExit(f"this step failed: {command}\n{error}") from error
    if said is not None:
        raise SystemExit(f"this step failed ({said}): {command}")
