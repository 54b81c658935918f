"""Where a run lies, which run lies there, and the config.yaml that is kept of it."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from tstar_rl.checks import InvalidValueError
from tstar_rl.runs.files import replacing, turn_to_write
from tstar_rl.runs.versions import versions

__all__ = [
    "RECIPES",
    "UNTRAINED",
    "Place",
    "made_by",
    "note_evaluation",
    "note_resumed",
    "read_run_path",
    "run_path",
    "write_config",
]

UNTRAINED = "no_finetuning"
"""The system of a chain whose skills are as they were trained alone: there is no recipe, and no run, of that name."""

RECIPES = Path(__file__).resolve().parents[2] / "recipes"
"""Of a clone; where the package is installed there is no such folder."""


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
    with turn_to_write(folder):
        _replace(folder, {**config, "versions": versions()})


def note_resumed(folder: Path, env_steps: int) -> None:
    """Adds to config.yaml that a run went on with other versions, or at another commit, than it began with.

    Args:
        folder: of the run's results.
        env_steps: after which it went on.
    """
    _note_later(folder, {"what": "resumed", "env_steps": env_steps})


def note_training(folder: Path, values: Mapping[str, Any]) -> None:
    """Replaces the section training of config.yaml: a run that goes on may have been given more steps."""
    with turn_to_write(folder):
        kept = yaml.safe_load((folder / "config.yaml").read_text())
        _replace(folder, {**kept, "training": dict(values)})


def note_evaluation(folder: Path, config: Mapping[str, Any]) -> None:
    """Writes an evaluation's config.yaml, unless the folder has that of a training, which stays.

    `evaluation_only: true` in it tells the two apart. It is for what has no training of its own: skills chained as they
    are, the script. To a training's it adds that it was evaluated with other versions, or at another commit, if so.
    """
    file = folder / "config.yaml"
    if not file.is_file() or yaml.safe_load(file.read_text()).get("evaluation_only"):
        write_config(folder, {**config, "evaluation_only": True})
    else:
        _note_later(folder, {"what": "evaluated"})


def _note_later(folder: Path, line: dict[str, Any]) -> None:
    """Adds a line to `later` in config.yaml, once, if the versions of today are not those that the run began with."""
    with turn_to_write(folder):
        file, now = folder / "config.yaml", versions()
        kept = yaml.safe_load(file.read_text()) if file.is_file() else {}
        later, line = kept.get("later", []), {**line, "versions": now}
        if kept.get("versions") != now and line not in later:
            _replace(folder, {**kept, "later": [*later, line]})


def _replace(folder: Path, values: Mapping[str, Any]) -> None:
    with replacing(folder / "config.yaml") as partial:
        partial.write_text(yaml.safe_dump(values, sort_keys=False))
