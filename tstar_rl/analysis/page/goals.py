"""How far the arms of an experiment get towards its goals, as a table of the notes."""

import math
from collections.abc import Collection

from tstar_rl.analysis.experiments import Experiment, check_arms
from tstar_rl.analysis.goals import goal_levels
from tstar_rl.analysis.page.contents import Entry
from tstar_rl.analysis.page.markdown import NOTHING, Paper, arm_label, arm_order, millions, table

__all__ = ["goal_table"]


def goal_table(
    experiment: Experiment, paper: Paper, entry: Entry, task: str, shown: Collection[str] = ()
) -> str:
    """A line for each arm, or for each of `shown`, what reaches a goal in bold; nothing if no goals were set.

    Raises:
        InvalidValueError: for an arm that the task does not have.
    """
    if entry.goals is None:
        return ""
    wanted, found = entry.goals.levels(), goal_levels(experiment, entry.goals, task)
    check_arms(task, shown, found.index)
    found = found[found.index.isin(shown)] if shown else found
    named = {"progress": "progress", "success": "whole task", "sampled": "sampled actions: progress"}
    named |= {over: f"improvement over {arm_label(paper, over)}" for over in entry.goals.over}
    lines = []
    for arm in arm_order(paper, found.index):
        row = found.loc[arm]
        levels = [_level(row[column], goal) for column, goal in wanted.items()]
        lines.append([arm_label(paper, arm), f"{row['seeds']:.0f}", *levels, millions(row["env_steps"])])
    header = [f"{named[column]} (goal {goal:.2f})" for column, goal in wanted.items()]
    return table(["arm", "seeds", *header, "environment steps"], lines)


def _level(value: float, goal: float) -> str:
    if math.isnan(value):
        return NOTHING
    return f"**{value:.3f}**" if value >= goal else f"{value:.3f}"
