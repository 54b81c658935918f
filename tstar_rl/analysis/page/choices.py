"""What each choice of an experiment adds, in the words of contents.yaml: one row a choice, for the notes."""

import math
from pathlib import Path
from textwrap import fill

from tstar_rl.analysis.differences import signed_interval
from tstar_rl.analysis.experiments import Experiment, compare_arms
from tstar_rl.analysis.figures import differences_figure, save_figure
from tstar_rl.analysis.page.contents import Entry
from tstar_rl.analysis.page.experiment import ordered
from tstar_rl.analysis.page.markdown import NOTHING, Paper, table

__all__ = ["choice_table", "draw_choices"]

HEADER = ["what is chosen", "change in progress [95%, bootstrap]", "95%, Student's t", "seeds", "verdict"]
WIDTH = 46
"""Letters of a line beside the figure."""
SMALL = 0.05
"""A difference whose two intervals lie within this of zero is called small, whatever its sign."""


def choice_table(experiment: Experiment, paper: Paper, entry: Entry, task: str) -> str:
    """The differences of `entry.choices` on the seeds that both arms have; nothing if none shares a seed."""
    found = compare_arms(ordered(experiment, paper, task), tuple(entry.choices.values()), absent_ok=True)
    rows = {(row.first, row.second): row for row in found.itertuples()}
    lines = []
    for said, pair in entry.choices.items():
        if (row := rows.get(pair)) is None:
            continue
        mean, half, low, high = (
            float(getattr(row, name)) for name in ("difference", "t_half", "low", "high")
        )
        small = all(
            abs(end) < SMALL for end in (low, high, mean - half, mean + half)
        )  # half is nan where Student says nothing
        student = NOTHING if math.isnan(half) else f"{mean - half:+.3f} to {mean + half:+.3f}"
        verdict = str(row.verdict)
        if small:
            told = "" if verdict == "no clear difference" else f"{verdict}, "
            verdict = f"{told}within {SMALL} of zero"
        lines.append([said, signed_interval(mean, low, high), student, str(row.seeds), verdict])
    return table(HEADER, lines) if lines else ""


def draw_choices(experiment: Experiment, paper: Paper, entry: Entry, task: str, figures: Path) -> list[Path]:
    """The same as a figure, which the notes show, if anything was chosen: a dot for each seed, with both intervals."""
    rows = ordered(experiment, paper, task)
    if not entry.choices or compare_arms(rows, tuple(entry.choices.values()), absent_ok=True).empty:
        return []
    said = {pair: fill(words.replace("**", ""), WIDTH) for words, pair in entry.choices.items()}
    figure = differences_figure(rows, list(said), said=said, absent_ok=True)
    return [save_figure(figure, figures / f"{entry.prefix}{task}_choices.png")]
