"""A line for each task of an experiment: its skills, what every arm's chains do, and the hand-over gap."""

import pandas as pd

from tstar_rl.analysis.experiments import Experiment
from tstar_rl.analysis.gaps_of_runs import hand_over_gaps
from tstar_rl.analysis.over_tasks import skills_of_tasks
from tstar_rl.analysis.page.contents import Entry
from tstar_rl.analysis.page.markdown import NOTHING, Paper, arm_label, arm_order, from_to, table
from tstar_rl.runs.run_folder import UNTRAINED

__all__ = ["each_task"]

READING = """\
Success of the skills from their own starts, in order, then progress of the chains; means over seeds. The hand-over gap
is that of {arm}.
"""


def each_task(experiment: Experiment, paper: Paper, entry: Entry) -> str:
    """The table of tasks, deterministic, last checkpoints."""
    arms, lines = arm_order(paper, map(str, experiment.arms["arm"])), []
    before = UNTRAINED if UNTRAINED in arms else entry.reference
    skills = skills_of_tasks(experiment, before)
    for task in experiment.tasks:
        rows, gaps = experiment.chosen(task), hand_over_gaps(experiment, task)
        gap = gaps[(gaps["arm"] == before) & ~gaps["arm"].isin(entry.no_gap)]["gap"]
        cells = [_mean(rows[rows["arm"] == arm]["progress"]) for arm in arms]
        alone = " ".join(f"{success:.2f}" for success in skills.get(task, ())) or NOTHING
        lines.append([f"`{task}`", alone, _seeds(rows), *cells, _mean(gap)])
    header = ["task", "skills", "seeds", *(arm_label(paper, arm) for arm in arms), "hand-over gap"]
    return f"{READING.format(arm=arm_label(paper, before))}\n{table(header, lines)}"


def _mean(values: pd.Series) -> str:
    return NOTHING if values.isna().all() else f"{values.mean():.3f}"


def _seeds(rows: pd.DataFrame) -> str:
    """How many seeds the arms have, the fewest and the most."""
    if rows.empty:
        return NOTHING
    counts = rows.groupby("arm")["seed"].nunique()
    return from_to(int(counts.min()), int(counts.max()))
