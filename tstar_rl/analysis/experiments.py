"""An experiment: arms that were trained with the same seeds, its table and its comparisons.

Its folder is <root>/<task>/<arm>/seed<k>/{config.yaml,metrics.csv,evaluation.csv}. Skills that the arms start from lie
beside them, as <skills>/seed<k>/subtask<i>/. A hand_over.csv below a task has what each skill does from its own starts.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tstar_rl.analysis.differences import paired_difference
from tstar_rl.analysis.statistics import seed_means
from tstar_rl.analysis.tables import (
    episode_progress,
    evaluations_of,
    is_one_commit,
    read_hand_over,
    short_commit,
)
from tstar_rl.analysis.task_statistics import improvement_over_tasks, interquartile_interval
from tstar_rl.checks import InvalidValueError, did_you_mean
from tstar_rl.config.limits import MODES
from tstar_rl.runs.run_folder import SAVED

__all__ = [
    "Experiment",
    "arm_scores",
    "arm_table",
    "check_arms",
    "compare_arms",
    "read_experiment",
]

TaskScores = dict[str, dict[str, dict[int, NDArray[np.floating]]]]
"""By task, arm and seed: (episodes,) progress of every episode.

Progress is the share of a task's subtasks that were done, in [0, 1] whether it has two of them or seven. So it can be
compared over tasks, as the length of an episode cannot.
"""
SEED = 0
"""Of the generator of every single interval: one does not depend on which others are made."""


@dataclass(frozen=True)
class Experiment:
    """The tables of an experiment."""

    root: Path
    arms: pd.DataFrame
    """A row for each task, arm, seed, checkpoint and mode: the columns of evaluation.csv, and commit; none where only
    skills were trained yet."""
    skills: pd.DataFrame
    """The same of skills alone, with the subtask of each."""
    hand_over: pd.DataFrame
    """Columns task, arm, seed, checkpoint, subtask, own_starts, handed_over and their intervals."""

    @property
    def tasks(self) -> list[str]:
        return sorted(set(self.arms["task"])) if len(self.arms) else []

    def chosen(self, task: str, checkpoint: str = "last", mode: str = "deterministic") -> pd.DataFrame:
        """A row for each arm and seed; none where a checkpoint or a mode was not evaluated.

        Raises:
            InvalidValueError: for an unknown checkpoint or mode, or a task that has no run here.
        """
        known = sorted({*SAVED, *self.arms.get("checkpoint", ())})
        if checkpoint not in known:
            raise InvalidValueError(
                f"checkpoint must be one of {', '.join(known)}; got {checkpoint!r}{did_you_mean(checkpoint, known)}"
            )
        if mode not in MODES:
            raise InvalidValueError(f"mode must be one of {', '.join(MODES)}; got {mode!r}")
        if self.tasks and task not in self.tasks:
            raise InvalidValueError(
                f"{self.root} has the tasks {', '.join(self.tasks)}; got {task!r}{did_you_mean(task, self.tasks)}"
            )
        rows = self.arms[(self.arms["task"] == task) & (self.arms["checkpoint"] == checkpoint)]
        return rows[rows["mode"] == mode].sort_values(["arm", "seed"], ignore_index=True)

    def scores(self, checkpoint: str = "last", mode: str = "deterministic") -> TaskScores:
        """The progress of every episode; see `TaskScores`."""
        return {task: arm_scores(self.chosen(task, checkpoint, mode)) for task in self.tasks}

    def commits(self) -> dict[str, list[str]]:
        """The runs of each commit, as task/arm/seed<k>, those of skills too; see `commit_of`."""
        found: dict[str, list[str]] = {}
        runs = pd.concat([self.arms, self.skills]).drop_duplicates(["task", "arm", "seed", "commit"])
        for row in runs.itertuples():
            found.setdefault(str(row.commit), []).append(f"{row.task}/{row.arm}/seed{row.seed}")
        return found

    def check_one_commit(self) -> None:
        """Raises InvalidValueError, with the runs of each commit, unless all come from one, with nothing changed."""
        found = self.commits()
        if len(found) > 1 or not all(map(is_one_commit, found)):
            lines = "; ".join(f"{short_commit(commit)}: {', '.join(runs)}" for commit, runs in found.items())
            said = f"{self.root}: all runs of an experiment must come from one commit, got {lines}"
            raise InvalidValueError(said)


def read_experiment(root: str | Path, one_commit: bool = False) -> Experiment:
    """Reads an experiment's folder.

    Args:
        root: of the experiment.
        one_commit: refuse arms whose config.yaml name different commits, or none.

    Raises:
        FileNotFoundError: if neither an arm nor a skill has an evaluation.csv.
        InvalidValueError: see `Experiment.check_one_commit`.
    """
    found = evaluations_of(root)
    if found.empty:
        raise FileNotFoundError(f"no <task>/<arm>/seed<k>/evaluation.csv below {root}")
    found = found.rename(columns={"recipe": "arm"})
    alone = found["subtask"] >= 0
    hand_over = read_hand_over(root).rename(columns={"system": "arm"})
    arms = found[~alone].drop(columns="subtask").reset_index(drop=True)
    experiment = Experiment(Path(root), arms, found[alone].reset_index(drop=True), hand_over)
    if one_commit:
        experiment.check_one_commit()
    return experiment


def check_arms(task: str, asked: Iterable[str], there: Iterable[str]) -> None:
    """Raises InvalidValueError for an arm that is asked for and that the task does not have."""
    there = list(there)
    if not there and (asked := list(asked)):
        raise InvalidValueError(f"{task} has no arms at all; got {', '.join(sorted(asked))}")
    if unknown := sorted(set(asked) - set(there)):
        raise InvalidValueError(
            f"{task} has no arm {', '.join(unknown)}; it has {', '.join(there)}{did_you_mean(unknown[0], there)}"
        )


def arm_scores(rows: pd.DataFrame) -> dict[str, dict[int, NDArray[np.floating]]]:
    """Of each arm and seed the progress of every episode; `rows` has one row for each arm and seed."""
    found: dict[str, dict[int, NDArray[np.floating]]] = {}
    for _, row in rows.iterrows():
        seeds = found.setdefault(str(row["arm"]), {})
        if row["seed"] in seeds:
            raise ValueError(
                f"arm {row['arm']} has two rows of seed {row['seed']}: choose checkpoint and mode"
            )
        try:
            seeds[int(row["seed"])] = episode_progress(row)
        except ValueError as error:
            raise ValueError(f"{row.get('task', '')} {row['arm']}, seed {row['seed']}: {error}") from error
    return found


def arm_table(rows: pd.DataFrame) -> pd.DataFrame:
    """A line for each arm of one task: interquartile means over seeds of progress and success, with intervals.

    Args:
        rows: with columns arm, seed, episodes, progress and subtask_0, ...; one row for each arm and seed.

    Returns:
        Index arm, in the order of `rows`; columns seeds, episodes, progress, progress_low, progress_high, and the same
        three of success.
    """
    lines = {arm: _levels(_kept(seeds)) for arm, seeds in arm_scores(rows).items()}
    return pd.DataFrame.from_dict(lines, orient="index").rename_axis("arm")


def compare_arms(rows: pd.DataFrame, pairs: Iterable[Sequence[str]], absent_ok: bool = False) -> pd.DataFrame:
    """Differences in progress of pairs of arms, paired by seed; pairs without a common seed are left out.

    Args:
        rows: see `arm_table`.
        pairs: (first, second): the difference is first minus second.
        absent_ok: leaves out pairs with an arm that is not there, as of an experiment that is under way.

    Returns:
        Columns first, second, seeds, difference, low, high (bootstrap), t_half and p_value (Student's t), improvement
        (probability that a seed of the first beats one of the second), improvement_low, improvement_high, won (on how
        many seeds the first has more than the second) and verdict.

    Raises:
        InvalidValueError: for an arm that is not there, unless that is allowed.
    """
    scores, lines = {arm: _kept(seeds) for arm, seeds in arm_scores(rows).items()}, []
    pairs = [tuple(pair) for pair in pairs]
    if not absent_ok:
        check_arms("what is compared", {arm for pair in pairs for arm in pair}, scores)
    for first, second in pairs:
        line = _compare(scores.get(first, ()), scores.get(second, ()))
        if line:
            lines.append({"first": first, "second": second, **line})
    return pd.DataFrame(lines)


Kept = tuple[tuple[int, bytes], ...]
"""An arm's scores by seed, as what a cache can look up."""


def _kept(seeds: Mapping[int, NDArray[np.floating]]) -> Kept:
    return tuple((seed, scores.astype(float).tobytes()) for seed, scores in sorted(seeds.items()))


@cache
def _levels(arm: Kept) -> Mapping[str, float]:
    """A line of `arm_table`. A page asks for each several times."""
    scores = [np.frombuffer(each) for _, each in arm]
    line: dict[str, float] = {"seeds": len(scores), "episodes": sum(map(len, scores))}
    for name, of_seeds in (("progress", scores), ("success", [each >= 1.0 for each in scores])):
        line |= interquartile_interval([of_seeds], np.random.default_rng(SEED)).columns(name)
    return line


@cache
def _compare(first: Kept, second: Kept) -> Mapping[str, Any]:
    """A line of `compare_arms` without its names, none without a common seed; see `_levels`."""
    one, other = ({seed: np.frombuffer(scores) for seed, scores in arm} for arm in (first, second))
    if not set(one) & set(other):
        return {}
    found = paired_difference(one, other, np.random.default_rng(SEED))
    both = [[arm[seed] for seed in sorted(set(one) & set(other))] for arm in (one, other)]
    better = improvement_over_tasks(*([scores] for scores in both), np.random.default_rng(SEED))
    line = {"seeds": found.seeds, "difference": found.value}
    line |= {"low": found.low, "high": found.high, "t_half": found.t_half, "p_value": found.p_value}
    line |= {"improvement": better.value, "improvement_low": better.low, "improvement_high": better.high}
    line["won"] = int((seed_means(both[0]) > seed_means(both[1])).sum())
    return line | {"verdict": found.verdict()}
