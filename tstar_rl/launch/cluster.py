"""Recipes run as tasks of a Ray cluster."""

import os
import runpy
import shlex
import sys
from collections.abc import Sequence
from functools import partial

from tstar_rl.launch.children import child
from tstar_rl.launch.overrides import config_folders
from tstar_rl.launch.side_by_side import Step
from tstar_rl.rollouts.cluster import RETRIES, ClusterSettings, connect, resources
from tstar_rl.runs.run_folder import RECIPES

__all__ = ["run_on_cluster"]


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
        SystemExit: if it fails, or is ended with `end_children`, with its command.
    """
    ray = connect(settings, workers)
    name, *own = step
    # Bars of several nodes on one screen cannot be read.
    values = [*config_folders(), *shared, *own, "progress_bar=false"]
    script = str(RECIPES / f"{name}.py")
    remote = ray.remote(max_calls=1, max_retries=RETRIES, **resources(settings))(_recipe)
    command = shlex.join([script, *values])
    task = remote.options(name=f"{name} {' '.join(own)}").remote(script, values, os.getcwd())
    try:
        with child(partial(ray.cancel, task, force=True)):
            said = ray.get(task)
    except ray.exceptions.RayError as error:
        raise SystemExit(f"this step failed: {command}\n{error}") from error
    if said is not None:
        raise SystemExit(f"this step failed ({said}): {command}")
