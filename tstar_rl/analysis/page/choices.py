"""What each choice of an experiment adds, in the words of contents.yaml: one row a choice, for the notes."""

import math

from tstar_rl.analysis.experiments import Experiment, compare_arms
from tstar_rl.analysis.page.contents import Entry
from tstar_rl.analysis.page.experiment import ordered
from tstar_rl.analysis.page.markdown import NOTHING, Paper, signed_interval, table

__all__ = ["choice_table"]

HEADER = ["what is chosen", "adds to progress [95%, bootstrap]", "95%, Student's t", "seeds", ""]


def choice_table(experiment: Experiment, paper: Paper, entry: Entry, task: str) -> str:
    """The differences of `entry.choices` on the seeds that both arms have; nothing if none shares a seed."""
    found = compare_arms(ordered(experiment, paper, task), tuple(entry.choices.values()))
    rows = {(row.first, row.second): row for row in found.itertuples()}
    lines = []
    for said, pair in entry.choices.items():
        if (row := rows.get(pair)) is None:
            continue
        span = signed_interval(row.difference, row.low, row.high)
        half = row.t_half
        student = (
            NOTHING if math.isnan(half) else f"{row.difference - half:+.2f} to {row.difference + half:+.2f}"
        )
        lines.append([said, span, student, str(row.seeds), str(row.verdict)])
    return table(HEADER, lines) if lines else ""
