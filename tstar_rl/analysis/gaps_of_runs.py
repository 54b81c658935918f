"""The hand-over gap of every run of an experiment: what a chaining method could mend there."""

import math
from typing import Any

import pandas as pd

from tstar_rl.analysis.experiments import Experiment
from tstar_rl.analysis.hand_over_gap import product_of_skills
from tstar_rl.analysis.tables import config_of
from tstar_rl.runs.run_folder import SKILLS, is_untrained, run_path

__all__ = ["hand_over_gaps", "links_of"]


def hand_over_gaps(experiment: Experiment, task: str, checkpoint: str = "last") -> pd.DataFrame:
    """What a chaining method could mend: product of the skills' own success minus the chain's progress, for each run.

    Own success is that of hand_over.csv for the same arm and seed. An arm without it takes that of the skills that it
    started from (`skills` in its config.yaml), where they were evaluated alone.

    Returns:
        Columns arm, seed, progress, product, gap, and fine_tuned (whether own success is of the arm's own skills); nan
        where nothing is known of the skills.
    """
    own_starts = _by_run(experiment.hand_over, task)
    skills = experiment.skills
    alone = _by_run(skills if skills.empty else skills[skills["mode"] == "deterministic"], task)
    lines = []
    for _, row in experiment.chosen(task, checkpoint).iterrows():
        arm, seed = str(row["arm"]), int(row["seed"])
        tuned = (arm, seed, checkpoint) in own_starts
        if tuned:
            own = _of_whole_chain(own_starts[arm, seed, checkpoint], "own_starts", row)
        else:
            config = config_of(run_path(experiment.root, task, arm, seed))
            begun = checkpoint if is_untrained(arm) else config.get("from_checkpoint", "last")
            found = alone.get((config.get("skills", SKILLS), seed, begun))
            own = [] if found is None else _of_whole_chain(found, "success", row)
        progress, product = float(row["progress"]), product_of_skills(own) if own else math.nan
        line = {"arm": arm, "seed": seed, "progress": progress, "product": product}
        lines.append(line | {"gap": product - progress, "fine_tuned": tuned})
    return pd.DataFrame(lines)


def links_of(run: pd.Series) -> int:
    """Skills of the chain of a run, a row of `Experiment.chosen`; it may be shorter than the task."""
    return sum(str(name).startswith("subtask_") and not pd.isna(run[name]) for name in run.index)


def _by_run(table: pd.DataFrame, task: str) -> dict[tuple[Any, ...], pd.DataFrame]:
    """The rows of each arm, seed and checkpoint, a skill each, in their order."""
    if table.empty:
        return {}
    rows = table[table.task == task].sort_values("subtask")
    return dict(iter(rows.groupby(["arm", "seed", "checkpoint"])))


def _of_whole_chain(skills: pd.DataFrame, column: str, run: pd.Series) -> list[float]:
    """A column of the skills of a run's chain, which may be shorter than the task; empty where one is lacking."""
    links = links_of(run)
    skills = skills[skills["subtask"] < links]
    return skills[column].tolist() if skills["subtask"].tolist() == list(range(links)) else []
