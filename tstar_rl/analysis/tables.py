"""Reading what runs leave behind: metrics.csv, evaluation.csv, hand_over.csv and config.yaml, as pandas tables.

A folder of results holds <task>/<system>/seed<k>[/subtask<i>]/. What has no subtask is a chain, or one policy for the
whole task; its subtask reads -1.
"""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tstar_rl.checks import InvalidValueError
from tstar_rl.runs.csv_tables import read_table
from tstar_rl.runs.run_config import read_config
from tstar_rl.runs.run_folder import read_run_path
from tstar_rl.runs.versions import DIRTY, UNKNOWN

__all__ = [
    "check_seed",
    "commit_of",
    "config_of",
    "episode_progress",
    "evaluation_table",
    "evaluations_of",
    "is_one_commit",
    "read_calibration",
    "read_evaluations",
    "read_hand_over",
    "read_metrics",
    "short_commit",
    "skills_of_arms",
    "whole_task",
]


def read_metrics(root: str | Path = "results") -> pd.DataFrame:
    """The metrics.csv of every run below `root`, with columns task, recipe, seed, subtask; see `read_evaluations`."""
    return _read(root, "metrics.csv")


def read_evaluations(root: str | Path = "results") -> pd.DataFrame:
    """The evaluation.csv of every run below `root`, with columns task, recipe, seed, subtask and commit added.

    Skills that an arm has for itself lie below it; their recipe is <arm>/<recipe>. Chains of a system with a slash in
    its name (`pretrained/tstar`) are left out.

    Raises:
        InvalidValueError: if a table has rows of another seed than its folder's.
    """
    return _read(root, "evaluation.csv", commits=True)


def evaluations_of(root: str | Path) -> pd.DataFrame:
    """`read_evaluations` of an experiment, in which a script, which does not learn, is its own last checkpoint."""
    return read_evaluations(root).replace({"checkpoint": {"script": "last"}})


def read_calibration(root: str | Path = "results") -> pd.DataFrame:
    """Every calibration.csv below `root`, with columns task, recipe, seed, subtask added.

    A row is a bin of the scores that a signal gave, after one turn, to the states that a skill handed over: mean score,
    mean outcome, number of states.
    """
    return _read(root, "calibration.csv")


def read_hand_over(root: str | Path = "results") -> pd.DataFrame:
    """Every hand_over.csv below `root`, with column task added: success of each skill of a chain.

    `own_starts` is from the skill's own starts, `handed_over` from where the skill before ends.
    """
    frames = [
        read_table(file).assign(task=file.parent.name) for file in sorted(Path(root).glob("*/hand_over.csv"))
    ]
    return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()


def _read(root: str | Path, name: str, commits: bool = False) -> pd.DataFrame:
    root = Path(root)
    depths = ("*/*/seed*", "*/*/seed*/subtask*")
    files = [file for depth in depths for file in sorted(root.glob(f"{depth}/{name}"))]
    files += _of_arms_own_skills(root, name)
    configs = [file.parent / "config.yaml" for file in files if commits]
    known = tuple((file, _state(file)) for file in (*files, *filter(Path.is_file, configs)))
    return _together(root, tuple(files), commits, known).copy()


@cache
def _together(root: Path, files: tuple[Path, ...], commits: bool, known: tuple[Any, ...]) -> pd.DataFrame:
    """The rows of all files, as long as these and what names their commits are known to have one state."""
    frames = [_read_one(file, root) for file in files]
    if commits:
        frames = [
            rows.assign(commit=commit_of(file.parent)) for rows, file in zip(frames, files, strict=True)
        ]
    return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()


def _of_arms_own_skills(root: Path, name: str) -> list[Path]:
    """Tables of skills below an arm's folder, which is one that has seeds of its own."""
    below = sorted(root.glob(f"*/*/*/seed*/subtask*/{name}"))
    return [file for file in below if any(file.parents[3].glob("seed*"))]


def _read_one(file: Path, root: Path) -> pd.DataFrame:
    """The table of a run, with its task, recipe, seed and subtask."""
    table, (place, _) = _parsed(file, _state(file)), read_run_path(file.relative_to(root), root)
    check_seed(table, place.seed, file)
    subtask = -1 if place.subtask is None else place.subtask
    return table.assign(task=place.task, recipe=place.system, seed=place.seed, subtask=subtask)


def check_seed(table: pd.DataFrame, seed: int, file: Path) -> None:
    """Raises InvalidValueError if a run's table has rows of another seed, as that of a copied folder has."""
    if seeds := set(table.get("seed", ())) - {seed}:
        others = ", ".join(map(str, sorted(seeds)))
        raise InvalidValueError(
            f"{file} has rows of seed {others}: they are another run's; delete them and evaluate that run"
        )


def commit_of(folder: Path) -> str:
    """The commit that a run's config.yaml names, 40 hex digits; "unknown" where it names none.

    "-dirty" follows if the code differed from it. A run that went on, or was evaluated, at another one has both, in
    their order, with "+" between them.
    """
    config = config_of(folder)
    noted = [config, *config.get("later", [])]
    return "+".join(dict.fromkeys(str(one.get("versions", {}).get("commit", UNKNOWN)) for one in noted))


def config_of(folder: Path) -> Mapping[str, Any]:
    """The values in a run's config.yaml, none where it has none: not to be changed, for it is read once."""
    file = folder / "config.yaml"
    return _values(folder, _state(file)) if file.is_file() else {}


def _state(file: Path) -> tuple[int, ...]:
    """What is another after a file was written again."""
    known = file.stat()
    return known.st_mtime_ns, known.st_size, known.st_ino


@cache
def _parsed(file: Path, state: tuple[int, ...]) -> pd.DataFrame:
    """A file's table as long as it has this state: a page reads each of some thousand files several times."""
    return read_table(file)


@cache
def _values(folder: Path, state: tuple[int, ...]) -> Mapping[str, Any]:
    return read_config(folder)


def is_one_commit(commit: str) -> bool:
    """Whether a run's commit, as `commit_of` gives it, is one that can be checked out to make the run again."""
    return commit != UNKNOWN and "+" not in commit and not commit.endswith(DIRTY)


def short_commit(commit: str) -> str:
    """A run's commit, as `commit_of` gives it, with 7 digits of each."""
    parts = [(one.removesuffix(DIRTY), DIRTY if one.endswith(DIRTY) else "") for one in commit.split("+")]
    return "+".join(one[:7] + end for one, end in parts)


def skills_of_arms(evaluations: pd.DataFrame, task: str, mode: str = "deterministic") -> pd.DataFrame:
    """Rows of the last checkpoints of a task's skills from their own starts, by subtask, arm and seed.

    Args:
        evaluations: of `read_evaluations`.
        task: furniture.
        mode: of the actions, deterministic or stochastic.
    """
    chosen = (evaluations["task"] == task) & (evaluations["subtask"] >= 0)
    chosen &= (evaluations["checkpoint"] == "last") & (evaluations["mode"] == mode)
    return evaluations[chosen].sort_values(["subtask", "recipe", "seed"], ignore_index=True)


def whole_task(evaluations: pd.DataFrame, task: str) -> pd.DataFrame:
    """The rows of chains, and of policies for the whole task, in the order of their seeds."""
    if evaluations.empty:
        return evaluations
    chosen = evaluations[(evaluations.task == task) & (evaluations.subtask == -1)]
    return chosen.sort_values("seed", kind="stable")


def episode_progress(row: pd.Series) -> NDArray[np.floating]:
    """(episodes,) progress of every episode behind a row of an evaluation, in [0, 1], sorted.

    Subtasks are done in their order. So the share s_k of episodes that completed subtask k says how many completed
    exactly k + 1 of L subtasks: n (s_k - s_{k+1}).

    Raises:
        ValueError: if a later subtask was completed more often than an earlier one, or progress is not their mean.
    """
    names = sorted(
        (str(name) for name in row.index if str(name).startswith("subtask_")), key=lambda n: int(n[8:])
    )
    shares = np.array([float(row[name]) for name in names if not pd.isna(row[name])])
    number = int(row["episodes"])
    completed = np.round(shares * number).astype(int)
    if not len(completed) or (np.diff(completed) > 0).any():
        raise ValueError(f"shares of completed subtasks must not rise along the task, got {shares.tolist()}")
    if not abs(completed.mean() / number - row["progress"]) <= 0.5 / number:  # NaN is none
        raise ValueError(f"progress {row['progress']} is not the mean of the shares {shares.tolist()}")
    exactly = -np.diff([number, *completed, 0])
    return np.repeat(np.arange(len(completed) + 1) / len(completed), exactly)


def evaluation_table(
    evaluations: pd.DataFrame, checkpoint: str = "last", mode: str = "deterministic"
) -> pd.DataFrame:
    """Mean over seeds of each recipe's whole-task evaluation; for intervals over seeds see `experiments.arm_table`."""
    chosen = evaluations[(evaluations.subtask == -1) & (evaluations.checkpoint == checkpoint)]
    chosen = chosen[chosen["mode"] == mode]
    shares = [name for name in chosen.columns if name.startswith("subtask_")]
    columns = ["progress", "success", *shares, "env_steps", "minutes"]
    table = chosen.groupby(["task", "recipe"])[columns].mean()
    table.insert(0, "seeds", chosen.groupby(["task", "recipe"]).seed.nunique())
    return table
