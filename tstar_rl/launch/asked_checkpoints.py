"""Which checkpoints an evaluation is asked for by its command line, where they lie, and what their training took."""

import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from omegaconf import DictConfig, OmegaConf

from tstar_rl.chaining.chain import chain_folders
from tstar_rl.checks import InvalidValueError, MissingFileError
from tstar_rl.config.overrides import key_of
from tstar_rl.config.values import CONFIGS
from tstar_rl.launch.run_folders import evaluated_runs, run_folder, skills_took
from tstar_rl.runs.checkpoint import is_checkpoint
from tstar_rl.runs.run_config import read_config
from tstar_rl.runs.run_folder import SKILLS_TOOK, SPENT, is_untrained, made_by, read_run_path, spent_by

__all__ = ["Found", "find_checkpoints", "spent_on"]


class Found(NamedTuple):
    """Where the skills of a checkpoint lie, in order, and whether they are a chain: one of one skill is one, too."""

    folders: list[Path]
    chain: bool


def find_checkpoints(config: DictConfig, given: Iterable[str]) -> tuple[Path, dict[str, Found]]:
    """The folder of the table, and what each checkpoint found is.

    Args:
        config: its system, seed and subtask become those of config.path, where that is a run's.
        given: the values of the command line.

    Raises:
        MissingFileError: nothing is saved there.
        InvalidValueError: the path is of another run, or another checkpoint, than the command line asks for.
    """
    after = _take_from_path(config, given)
    results, names, chained = run_folder(config, "results_dir"), list(config.checkpoints), False
    if after is None or after.parts:  # a checkpoint, not a run
        path = Path(config.path)
        _check_checkpoints(config, given)
        homes, names = [path.parent], [path.name]
        results = path.parent if after is None else results / after.parent
    else:
        homes, chained = evaluated_runs(config), is_untrained(config.system)
    found = {name: _found([home / name for home in homes], chained) for name in names}
    complete = {name: one for name, one in found.items() if one is not None}
    if not complete:
        places = " or ".join(str(homes[0] / name) for name in names)
        raise MissingFileError(f"no skill and no chain at {places}{made_by(homes[0])}")
    return results, complete


def spent_on(config: DictConfig, results: Path, found: Found) -> dict[str, float]:
    """Environment steps and minutes that went into the skills, training and fine-tuning together.

    `results` is the folder of the table, whose config.yaml says what a chain began with.

    They are nan where a run has not ended, of one skill out of a chain, whose turns are not counted apart, and of a
    chain that lies in no run's folder and says nothing of its skills. The best checkpoint cost what the last one did:
    its whole run was needed to tell that it is the best.
    """
    in_chain = re.fullmatch(r"skill\d+", found.folders[0].name) is not None
    if in_chain and not found.chain:
        return dict.fromkeys(SPENT, math.nan)
    own = spent_by({folder.parents[1 if in_chain else 0] for folder in found.folders})
    if not in_chain:  # one policy, or skills as they are
        return own
    if SKILLS_TOOK not in read_config(results) and not _is_below(results, config.results_dir):
        return dict.fromkeys(SPENT, math.nan)
    skills = skills_took(config, results, len(found.folders))
    return {name: own[name] + skills[name] for name in SPENT}


def _is_below(folder: Path, root: str) -> bool:
    return folder.resolve().is_relative_to(Path(root).resolve())


def _found(places: list[Path], chained: bool) -> Found | None:
    """What is saved there: one skill each, `chained` as they are or one alone, or a chain; None: not all is there."""
    if all(map(is_checkpoint, places)):
        return Found(places, chained)
    folders = chain_folders(places[0]) if len(places) == 1 else []
    return Found(folders, True) if folders else None


def _take_from_path(config: DictConfig, given: Iterable[str]) -> Path | None:
    """Sets system, seed and subtask to those of the run that config.path is of; returns what follows the run's folder.

    That is nothing for the run itself, also where no path is asked for. None: the path is of no run.

    Raises:
        InvalidValueError: if the run is of another task, or is not what the command line asks for.
    """
    if config.path is None:
        return Path()
    path = Path(config.path).resolve()
    roots = [Path(config[name]).resolve() for name in ("results_dir", "runs_dir")]
    around = [root for root in roots if path.is_relative_to(root)]
    if not around:
        return None
    root = max(around, key=lambda one: len(one.parts))  # one of them may lie in the other
    place, after = read_run_path(below := path.relative_to(root))
    _check_that_it_lies_in(root, below, config)
    names = {key_of(value) for value in given} & {"system", "seed", "subtask"}
    asked = {"task": config.task.name, **{name: config[name] for name in sorted(names)}}
    for name, value in asked.items():
        found = getattr(place, name)
        if value != found:
            raise InvalidValueError(
                f"path={config.path} is of {name}={found}, but {name}={value} is asked for"
            )
    config.system, config.seed, config.subtask = place.system, place.seed, place.subtask
    return after


def _check_that_it_lies_in(root: Path, below: Path, config: DictConfig) -> None:
    """Raises InvalidValueError if a run lies further down than its task's folder, so below folders of its own."""
    tasks = {file.stem for file in (CONFIGS / "task").glob("*.yaml")}
    deeper = next((i for i, name in enumerate(below.parts) if name in tasks), 0)
    if deeper and below.parts[0] not in tasks:
        further = Path(*below.parts[:deeper])
        scale = CONFIGS / "scale" / f"{further}.yaml"
        given = f"runs_dir={Path(config.runs_dir) / further} results_dir={Path(config.results_dir) / further}"
        own = OmegaConf.load(scale).get("runs_dir") if scale.is_file() else None
        has_folders = own is not None and Path(own) == Path(config.runs_dir) / further
        if has_folders:
            given = f"scale={further}"
        raise InvalidValueError(
            f"path={config.path} lies in {further} of {root}: give the folders that it was trained with, {given}"
        )


def _check_checkpoints(config: DictConfig, given: Iterable[str]) -> None:
    """Raises InvalidValueError if other checkpoints are asked for than the one that config.path is."""
    name = Path(config.path).name
    if "checkpoints" in map(key_of, given) and list(config.checkpoints) != [name]:
        raise InvalidValueError(
            f"path={config.path} is one checkpoint: leave out checkpoints, got {list(config.checkpoints)}; or give the "
            "folder of the run as the path"
        )
