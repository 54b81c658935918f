"""Who mended the seams of chains: the skill that hands over, or the one that takes over."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tstar_rl.analysis.figures.panels import message, panels, readable

__all__ = ["exchanged_figure"]

VERSIONS = ("before", "after")
COLOURS = {"before": "0.6", "after": "C0"}
WIDTH = 0.38


def _bars(axes: Axes, rows: pd.DataFrame) -> None:
    """Groups: the second skill before and after. In each a bar for the first one before and after; a dot is a seed."""
    for group, taken_by in enumerate(VERSIONS):
        for side, handed_by in enumerate(VERSIONS):
            there = rows[(rows["taken_by"] == taken_by) & (rows["handed_by"] == handed_by)].dropna(
                subset="success"
            )
            if there.empty:
                continue
            place, mean = group + (side - 0.5) * WIDTH, there["success"].mean()
            axes.bar(place, mean, WIDTH * 0.92, color=COLOURS[handed_by], label=f"first skill as {handed_by}")
            if len(there) == 1:
                ends = [[mean - there["success_low"].iloc[0]], [there["success_high"].iloc[0] - mean]]
                axes.errorbar(place, mean, yerr=np.clip(ends, 0, None), fmt="none", color="black", capsize=3)
            else:
                offsets = np.linspace(-0.1, 0.1, len(there))
                axes.plot(place + offsets, there["success"], "o", color="black", markersize=3, alpha=0.7)
            axes.annotate(f"{mean:.2f}", (place, 0.02), ha="center", fontsize=7, color="white")


def exchanged_figure(table: pd.DataFrame) -> Figure:
    """Success of the second skill of each seam when one or both skills are exchanged for what they were before.

    A row of panels for each system, a column for each seam. One chain: bars with 95% intervals. Several seeds: means,
    and a dot for each.

    Args:
        table: rows of `exchanged.csv`, of one task and one checkpoint.
    """
    if table.empty:
        return message("no table yet: python recipes/exchanged.py")
    systems, seams = list(dict.fromkeys(table["system"])), sorted(set(table["subtask"]))
    figure, grid = panels(
        len(systems), len(seams), (2.9 * len(seams), 0.5 + 2.1 * len(systems)), sharey=True, sharex=True
    )
    for line, system in zip(grid, systems, strict=True):
        for axes, seam in zip(line, seams, strict=True):
            _bars(axes, table[(table["system"] == system) & (table["subtask"] == seam)])
            axes.set_title(f"{readable(system)}: skill {seam - 1} hands over to {seam}", fontsize=8)
            axes.set_xticks([0, 1], [f"second skill\nas {version}" for version in VERSIONS], fontsize=8)
            axes.set_ylim(0, 1.02)
        line[0].set_ylabel("the second skill succeeds")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    known = dict(zip(labels, handles, strict=True))
    figure.legend(known.values(), known.keys(), loc="outside lower center", ncols=2, fontsize=8)
    return figure
