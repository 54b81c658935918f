"""How a skill fares with each of two ways in which it can be handed the arm or a part."""

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from tstar_rl.analysis.figures.panels import COLOURS, message, panels, readable

__all__ = ["sides_figure"]

SIDES = {"below": COLOURS[1], "above": COLOURS[0]}
LARGEST = 160.0
"""Area of a dot that stands for all states, in square points."""


def _dots(axes: Axes, rows: pd.DataFrame) -> None:
    """Two dots for each seed, joined by a line; each as large as its share of the states."""
    for place, row in enumerate(rows.to_dict("records")):
        ends = row["succeeded_below"], row["succeeded_above"]
        axes.plot([place, place], ends, color="0.8", linewidth=1, zorder=1)
        for side, success, share in zip(SIDES, ends, (row["below"], 1 - row["below"]), strict=True):
            axes.scatter(place, success, s=LARGEST * share, color=SIDES[side], linewidths=0, zorder=2)
    axes.set_xticks(range(len(rows)), [str(seed) for seed in rows["seed"]], rotation=90, fontsize=7)
    axes.set_xlim(-0.6, len(rows) - 0.4)
    axes.set_ylim(-0.06, 1.06)


def sides_figure(table: pd.DataFrame) -> Figure:
    """Success of the skill that takes over, on either side of one input of the state that it is handed.

    A row of panels for each system, a column for each seam. A seed has two dots, as large as their
    shares of the states.

    Args:
        table: rows of `seams.csv`, of one task and one checkpoint. States that all have one value of the
            input have no dots; whether the others lie in two heaps is not asked.
    """
    shown = table.dropna(subset=["split"]) if "split" in table else pd.DataFrame()
    if shown.empty:
        return message("no states in two heaps: python recipes/hand_over_gap.py")
    systems, seams = list(dict.fromkeys(shown["system"])), sorted(set(shown["subtask"]))
    size = (1.2 + 2.2 * len(seams), 0.7 + 1.5 * len(systems))
    figure, grid = panels(len(systems), len(seams), size, sharey=True)
    for line, system in zip(grid, systems, strict=True):
        for axes, seam in zip(line, seams, strict=True):
            rows = shown[(shown["system"] == system) & (shown["subtask"] == seam)].sort_values("seed")
            _dots(axes, rows)
            by = ", ".join(dict.fromkeys(rows["split_by"]))
            axes.set_title(f"{readable(system)}: skill {seam} to {seam + 1}, {by}", fontsize=8)
        line[0].set_ylabel("succeeds", fontsize=8)
    handles = [
        Line2D([], [], marker="o", linestyle="", color=colour, label=f"{side} the split")
        for side, colour in SIDES.items()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=8)
    return figure
