"""Arms beside each other: every seed is a dot, intervals are those of the tables."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tstar_rl.analysis.ablations import as_arms, command
from tstar_rl.analysis.experiments import SEED, arm_scores, arm_table, compare_arms
from tstar_rl.analysis.figures.panels import (
    COLOURS,
    THRESHOLDS,
    arm_dots,
    arm_line,
    draw_profile,
    message,
    panels,
    readable,
)
from tstar_rl.analysis.task_statistics import profile_over_tasks

__all__ = [
    "ablation_figure",
    "arms_figure",
    "differences_figure",
    "draw_dots",
    "draw_interval",
    "name_rows",
]

KEY = (-0.14, -0.03)
"""Where the line of an arm's profile stands in its row, left of the middle panel and in parts of its width."""
MOST_BANDS = 6
"""Of more arms than these the bands of their profiles hide each other."""
ONE = {"color": COLOURS[0], "marker": "o"}
"""Dots of a difference."""


def draw_dots(axes: Axes, values: pd.Series, place: float, style: Mapping[str, Any]) -> None:
    """The values of an arm's seeds, spread a little sidewards so that equal ones are seen."""
    offsets = np.linspace(-0.16, 0.16, len(values)) if len(values) > 1 else [0.0]
    axes.plot(values, place + np.asarray(offsets), linestyle="", markersize=4.5, alpha=0.75, mew=0, **style)


def draw_interval(axes: Axes, row: pd.Series, measure: str, place: float) -> None:
    """Interquartile mean and interval, as a bar below the dots."""
    ends = [[row[measure] - row[f"{measure}_low"]], [row[f"{measure}_high"] - row[measure]]]
    style = {"fmt": "|", "color": "black", "capsize": 3, "markersize": 9, "markeredgewidth": 1.5}
    axes.errorbar(row[measure], place + 0.32, xerr=np.clip(ends, 0, None), **style)


def name_rows(axes: Axes, words: Sequence[str], **style: Any) -> None:
    """What the rows are called, from top to bottom; `style` is that of the words."""
    axes.set_yticks(range(len(words)), words, **style)
    axes.set_ylim(len(words) - 0.4, -0.5)


def _draw_arms(axes: Axes, rows: pd.DataFrame, measure: str) -> None:
    for place, (arm, row) in enumerate(arm_table(rows).iterrows()):
        draw_dots(axes, rows[rows["arm"] == arm].sort_values("seed")[measure], place, arm_dots(place))
        draw_interval(axes, row, measure, place)
    axes.set(xlabel=measure, xlim=(-0.02, 1.02))


def arms_figure(
    rows: pd.DataFrame, labels: Mapping[str, str] | None = None, profiled: Collection[str] = ()
) -> Figure:
    """Progress and success of the arms of one task, and the performance profile of progress.

    A dot is a seed; below the dots stand the interquartile mean and its 95% interval. The profile is the share of
    seeds whose progress is above a value; its lines are named in the rows of the arms. With few arms it has its
    pointwise 95% band too.

    Args:
        rows: see `experiments.arm_table`.
        labels: of arms.
        profiled: arms whose profile is drawn; none named: all.
    """
    scores = arm_scores(rows)
    drawn = set(profiled) & set(scores) or set(scores)
    figure, grid = panels(1, 3, (13, 1.6 + 0.42 * len(scores)))
    progress, success, profile = grid[0]
    for axes, measure in ((progress, "progress"), (success, "success")):
        _draw_arms(axes, rows, measure)
        name_rows(axes, [(labels or {}).get(arm, readable(arm)) for arm in scores])
    success.set_yticklabels([" " * 8] * len(scores))
    for place, (arm, seeds) in enumerate(scores.items()):
        if arm not in drawn:
            continue
        band = profile_over_tasks([list(seeds.values())], THRESHOLDS, np.random.default_rng(SEED))
        draw_profile(profile, place, band if len(drawn) <= MOST_BANDS else band[:1])
        beside = {"transform": success.get_yaxis_transform(), "clip_on": False}
        success.plot(KEY, [place] * 2, **beside, **arm_line(place))
    profile.set(xlabel="progress above", ylabel="share of seeds", xlim=(0, 1), ylim=(-0.02, 1.04))
    return figure


def differences_figure(
    rows: pd.DataFrame,
    pairs: Iterable[Sequence[str]],
    labels: Mapping[str, str] | None = None,
    said: Mapping[tuple[str, str], str] | None = None,
    absent_ok: bool = False,
) -> Figure:
    """Paired differences in progress of one task: a dot for each seed, mean, bootstrap interval and Student's t.

    Args:
        rows: see `experiments.arm_table`.
        pairs: see `experiments.compare_arms`.
        labels: of arms.
        said: what a pair is called; the others by their two arms.
        absent_ok: see `experiments.compare_arms`.
    """
    table, named, called = compare_arms(rows, pairs, absent_ok), labels or {}, said or {}
    if table.empty:
        return message("no two arms have a seed in common")
    by_seed = rows.pivot_table(index="seed", columns="arm", values="progress", observed=True)
    figure, grid = panels(1, 1, (8, 1.4 + 0.55 * len(table)))
    axes = grid[0, 0]
    for place, (_, row) in enumerate(table.iterrows()):
        draw_dots(axes, (by_seed[row["first"]] - by_seed[row["second"]]).dropna(), place, ONE)
        mean = row["difference"]
        ends = np.clip([[mean - row["low"]], [row["high"] - mean]], 0, None)
        if np.isfinite(row["t_half"]):
            axes.errorbar(mean, place + 0.34, xerr=row["t_half"], fmt="none", color="0.6", capsize=3)
        style = {"fmt": "|", "color": "black", "capsize": 3, "markersize": 9, "markeredgewidth": 1.5}
        axes.errorbar(mean, place + 0.26, xerr=ends, **style)
    words = [
        called.get((row.first, row.second))
        or f"{named.get(row.first, readable(row.first))}\nless {named.get(row.second, readable(row.second))}"
        for row in table.itertuples()
    ]
    name_rows(axes, words, fontsize=8)
    axes.axvline(0, color="black", linewidth=0.8)
    axes.set_xlabel("difference in progress, same seed\n95%: bootstrap black, Student's t grey")
    return figure


def ablation_figure(rows: pd.DataFrame) -> Figure:
    """Progress and success of every variant of an ablation, a row of panels for each task; see `arms_figure`."""
    if not len(rows):
        return message(f"no table yet: {command(rows.attrs['ablation'])}")
    tasks = list(dict.fromkeys(rows["task"]))
    height = 1.2 + 0.42 * rows["variant"].nunique()
    figure, grid = panels(len(tasks), 2, (11, height * len(tasks)))
    for line, task in zip(grid, tasks, strict=True):
        part = as_arms(rows[rows["task"] == task])
        for axes, measure in zip(line, ("progress", "success"), strict=True):
            _draw_arms(axes, part, measure)
            name_rows(axes, [readable(arm) for arm in dict.fromkeys(part["arm"])])
            axes.set_title(f"{task}: {measure}", fontsize=9)
        line[1].set_yticklabels([])
    return figure
