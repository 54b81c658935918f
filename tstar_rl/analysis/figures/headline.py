"""The figure that the page leads with: a few arms of one experiment, and the differences that answer its questions."""

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tstar_rl.analysis.experiments import arm_table
from tstar_rl.analysis.figures.arms import draw_dots, draw_interval, name_rows
from tstar_rl.analysis.figures.panels import COLOURS, panels

__all__ = ["DrawnDifference", "headline_figure"]

DOTS = {"color": COLOURS[0], "marker": "o"}
"""One style for all arms: a row's name says which it is."""
WIDTH = 28
"""Letters of a line of a row's name."""


class DrawnDifference(NamedTuple):
    """A row of the right half of the figure."""

    words: str
    by_seed: pd.Series
    """First arm less second, of each seed that both have."""
    found: pd.Series
    """The row of `experiments.compare_arms`."""


def headline_figure(
    rows: pd.DataFrame, arms: Mapping[str, str], differences: Sequence[DrawnDifference], margin: float
) -> Figure:
    """Progress of the arms on the left, paired differences on the right. A dot is a seed.

    Args:
        rows: see `experiments.arm_table`.
        arms: names of the arms that are drawn, from top to bottom, and what each is called.
        differences: from top to bottom.
        margin: a difference smaller than this does not matter; drawn as a band about 0.

    Raises:
        ValueError: for an arm without rows.
    """
    missing = sorted(set(arms) - set(rows["arm"]))
    if missing:
        raise ValueError(
            f"no rows of {', '.join(missing)}; there are {', '.join(map(str, rows['arm'].unique()))}"
        )
    figure, (axes,) = panels(1, 2, (11, 1.4 + 0.42 * max(len(arms), len(differences))))
    _draw_arms(axes[0], rows, arms)
    _draw_differences(axes[1], differences, margin)
    return figure


def _draw_arms(axes: Axes, rows: pd.DataFrame, arms: Mapping[str, str]) -> None:
    table = arm_table(rows[rows["arm"].isin(list(arms))])
    for place, arm in enumerate(arms):
        draw_dots(axes, rows[rows["arm"] == arm].sort_values("seed")["progress"], place, DOTS)
        draw_interval(axes, table.loc[arm], "progress", place)
        axes.annotate(f"{table.loc[arm, 'progress']:.2f}", (1.03, place), va="center", fontsize=9)
    _name(axes, list(arms.values()))
    axes.set(
        xlim=(0, 1.13), xticks=np.arange(0, 1.1, 0.2), xlabel="progress: share of the subtasks that were done"
    )
    axes.set_title("A dot is a seed; bar: interquartile mean, 95%", fontsize=9)


def _draw_differences(axes: Axes, differences: Sequence[DrawnDifference], margin: float) -> None:
    axes.axvspan(-margin, margin, color="0.92", zorder=0)
    axes.axvline(0, color="black", linewidth=0.8)
    for place, (_, by_seed, row) in enumerate(differences):
        draw_dots(axes, by_seed, place, DOTS)
        mean, half = row["difference"], row["t_half"]
        ends = {"_low": np.fmin(row["low"], mean - half), "_high": np.fmax(row["high"], mean + half)}
        draw_interval(axes, pd.Series({"": mean, **ends}), "", place)
    _name(axes, [each.words for each in differences])
    axes.set_xlabel("difference in progress, same seed")
    axes.set_title(f"Bar: mean, the wider 95% interval; grey: less than {margin:g}", fontsize=9)


def _name(axes: Axes, words: Sequence[str]) -> None:
    name_rows(axes, [fill(each, WIDTH) for each in words], fontsize=9)
