"""Where a run lies, which run lies there, and the config.yaml that is kept of it."""

import re
import subprocess
import sys
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from tstar_rl.checks import InvalidValueError
from tstar_rl.runs.files import replacing, turn_to_write

__all__ = [
    "RECIPES",
    "UNTRAINED",
    "Place",
    "made_by",
    "note_evaluation",
    "read_run_path",
    "run_path",
    "write_config",
]

UNTRAINED = "no_finetuning"
"""The system of a chain whose skills are as they were trained alone: there is no recipe, and no run, of that name."""

RECIPES = Path(__file__).resolve().parents[2] / "recipes"
"""Of a clone; where the package is installed there is no such folder."""

CODE = ("*.py", "configs", "envs", "pyproject.toml")
"""What decides a run's figures, from the repository's root: a change there is recorded."""


class Place(NamedTuple):
    """What `run_path` takes after its root; the subtask is None for a chain and for the whole task."""

    task: str
    system: str
    seed: int
    subtask: int | None


def run_path(root: str | Path, task: str, recipe: str, seed: int, subtask: int | None = None) -> Path:
    """<root>/<task>/<recipe>/seed<k>[/subtask<i>]."""
    path = Path(root) / task / recipe / f"seed{seed}"
    return path if subtask is None else path / f"subtask{subtask}"


def read_run_path(path: Path) -> tuple[Place, Path]:
    """The inverse of `run_path`: the run that a path belongs to, and the rest of the path below the run's folder.

    Args:
        path: relative to the root.

    Raises:
        InvalidValueError: if it is not <task>/<recipe>/seed<k>[/subtask<i>][/...].
    """
    found = re.fullmatch(r"([^/]+)/(.+?)/seed(\d+)(?:/subtask(\d+))?(?:/(.*))?", path.as_posix())
    if found is None:
        raise InvalidValueError(f"a run lies at <task>/<recipe>/seed<k>[/subtask<i>], got {path}")
    task, system, seed, subtask, rest = found.groups()
    return Place(task, system, int(seed), None if subtask is None else int(subtask)), Path(rest or "")


def made_by(path: str | Path) -> str:
    """What a message says of a run's missing file: the recipe that writes it; nothing if the path is of no run."""
    found = re.search(r"([^/]+)/([^/]+)/seed(\d+)(?:/subtask(\d+))?(?:/|$)", Path(path).as_posix())
    if found is None:
        return ""
    task, system, seed, subtask = found.groups()
    part = "" if subtask is None else f" subtask={subtask}"
    if (RECIPES / f"{system}.py").is_file():
        return f": train it first (python recipes/{system}.py task={task}{part} seed={seed})"
    return f": train system={system} of task={task}{part} seed={seed} first"


def write_config(folder: Path, config: Mapping[str, Any]) -> None:
    """Writes config.yaml: plain values, the versions of what they ran on, and the commit."""
    kept = {**config, "versions": _versions()}
    with turn_to_write(folder), replacing(folder / "config.yaml") as partial:
        partial.write_text(yaml.safe_dump(kept, sort_keys=False))


def note_evaluation(folder: Path, config: Mapping[str, Any]) -> None:
    """Writes an evaluation's config.yaml, unless the folder has that of a training, which stays.

    `evaluation_only: true` in it tells the two apart. It is for what has no training of its own: skills chained as they
    are, the script.
    """
    file = folder / "config.yaml"
    if not file.is_file() or yaml.safe_load(file.read_text()).get("evaluation_only"):
        write_config(folder, {**config, "evaluation_only": True})


def _versions() -> dict[str, str]:
    names = ("torch", "torchrl", "tensordict", "mujoco", "tstar-rl")
    found: dict[str, str] = {"python": sys.version.split()[0]}
    for name in names:
        try:
            found[name] = version(name)
        except ModuleNotFoundError:
            found[name] = "not installed"
    return {**found, "commit": _commit() or "unknown"}


def _commit() -> str:
    """Of the repository that this file is tracked in, "-dirty" at its end if code or configs differ from it.

    Empty without git, or where the package is installed and no clone, also if it lies below another repository.
    """
    root, here = Path(__file__).parents[2], Path(__file__).name
    try:
        tracked = _git(Path(__file__).parent, "ls-files", "--error-unmatch", here)
        commit = _git(root, "rev-parse", "HEAD") if tracked else ""
        dirty = commit and _git(root, "status", "--porcelain", "--", *CODE)
    except FileNotFoundError:
        return ""
    return f"{commit}-dirty" if dirty else commit


def _git(folder: Path, *command: str) -> str:
    done = subprocess.run(["git", "-C", str(folder), *command], capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else ""
