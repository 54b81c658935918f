"""Learning curves: logged columns against environment steps."""

import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from tstar_rl.analysis.ablations import command
from tstar_rl.analysis.figures.panels import COLOURS, LINES, message, panels, readable

__all__ = ["ablation_curves", "learning_curves", "running_means", "seed_curves"]

OF_EPISODES = ("success_rate", "completed", "episode_length")
"""Columns that are means over the episodes of a rollout; others are over its steps."""
MOST_INSIDE = 12
"""Names of a legend that does not hide the lines."""
BESIDE = 6
"""Panels beside each other: more make a figure that a page cannot show."""


def learning_curves(
    metrics: pd.DataFrame, columns: Iterable[str] = ("success_rate", "episode_length", "kl")
) -> Figure:
    """One panel for each column that was logged, one line for each task, recipe, subtask, seed and skill.

    Raises:
        ValueError: if none of the columns was logged.
    """
    wanted = list(columns)
    columns = [name for name in wanted if name in metrics and metrics[name].notna().any()]
    if not columns:
        raise ValueError(f"none of {', '.join(wanted)} was logged; there are {', '.join(metrics.columns)}")
    figure, grid = panels(1, len(columns), (5 * len(columns), 4))
    named = ["task", "recipe"] if metrics["task"].nunique() > 1 else ["recipe"]
    by = [*named, "subtask", "seed", *(["skill"] if "skill" in metrics else [])]
    for axes, column in zip(grid[0], columns, strict=True):
        for number, (place, rows) in enumerate(metrics.groupby(by, dropna=False)):
            rows = rows.dropna(subset=[column])
            numbers = zip(by[len(named) :], place[len(named) :], strict=True)
            names = [*map(str, place[: len(named)]), *(f"{k} {int(v)}" for k, v in numbers if float(v) >= 0)]
            axes.plot(rows.env_steps, rows[column], label=" ".join(names), linewidth=1, **_line(number))
        axes.set(xlabel="environment steps", title=readable(column))
    _legend(grid.flat)
    return figure


def _line(place: int) -> dict[str, Any]:
    """Colour and dashes of one of 35 lines; the first seven are solid."""
    return {"color": COLOURS[place % len(COLOURS)], "linestyle": LINES[place // len(COLOURS) % len(LINES)]}


def _legend(shown_in: Iterable[Axes]) -> None:
    """Names the lines of several panels, in which some may be missing: in the first, or many beside the last."""
    every = list(shown_in)
    drawn = [axes.get_legend_handles_labels() for axes in every]
    known = {label: line for lines, labels in drawn for label, line in zip(labels, lines, strict=True)}
    if len(known) > MOST_INSIDE:
        beside = {"loc": "center left", "bbox_to_anchor": (1.01, 0.5), "ncols": 2}
        every[-1].legend(known.values(), known.keys(), fontsize=6, **beside)
    elif known:
        every[0].legend(known.values(), known.keys(), fontsize=7)


def _lines(axes: Axes, rows: pd.DataFrame, column: str, colour: str, values: Sequence[int]) -> None:
    """A line for each run in `rows`, in pieces where it does not train the same skill all the time.

    Args:
        axes: where.
        rows: of one panel.
        column: that is drawn.
        colour: the column whose value has a line's colour.
        values: all values of that in the figure: a colour means the same in each panel. Skills are counted from 1.
    """
    labelled = set()
    if colour == "seed":
        pieces = [colour]
    else:
        places = rows[[colour, "seed", "round"]].fillna(-1)
        rows = rows.assign(piece=(places != places.shift()).any(axis=1).cumsum())
        pieces = [colour, "seed", "piece"]
    for place, run in rows.groupby(pieces):
        value = int(place[0])  # pyright: ignore[reportGeneralTypeIssues]
        label = None if value in labelled else f"{colour} {value + (colour == 'skill')}"
        labelled.add(value)
        style = {"marker": ".", "markersize": 3, "linewidth": 1, **_line(values.index(value))}
        axes.plot(run.env_steps, run[column], label=label, **style)


def running_means(metrics: pd.DataFrame, columns: Iterable[str], window: int) -> pd.DataFrame:
    """The rows with running means in some columns, of each run by itself.

    Args:
        metrics: from `tables.read_metrics`.
        columns: one that was never logged is left out.
        window: rollouts, the row's own and those before it. Where a column is a mean over episodes, each counts by how
            many it has, one without any not at all.
    """
    columns = [name for name in columns if name in metrics]

    def smoothed(run: pd.DataFrame) -> pd.DataFrame:
        found = {}
        for name in columns:
            weights = run["episodes"].fillna(0) if name in OF_EPISODES else pd.Series(1.0, run.index)
            counted = weights.where(run[name].notna(), 0)
            total = (counted * run[name].fillna(0)).rolling(window, min_periods=1).sum()
            found[name] = total / counted.rolling(window, min_periods=1).sum().replace(0, float("nan"))
        return run.assign(**found)

    runs = [smoothed(run) for _, run in metrics.groupby(["task", "recipe", "seed", "subtask"], sort=False)]
    return pd.concat(runs) if runs else metrics


def seed_curves(metrics: pd.DataFrame, columns: Mapping[str, str], panel: str) -> Figure:
    """A row of panels for each logged column; thin lines are seeds.

    Args:
        metrics: from `tables.read_metrics`.
        columns: what has a colour in each: "seed" or, of a chain, "skill". A column that was never logged is left out.
        panel: column whose values have a panel each, in the order of their first rows, at most `BESIDE` beside each
            other; one that logged none of the columns has none.

    Raises:
        ValueError: if none of the columns was logged.
    """
    names = [name for name in columns if name in metrics and metrics[name].notna().any()]
    if not names:
        raise ValueError(f"none of {', '.join(columns)} was logged; there are {', '.join(metrics.columns)}")
    places = list(dict.fromkeys(metrics.dropna(subset=names, how="all")[panel]))
    bands = [places[first : first + BESIDE] for first in range(0, len(places), BESIDE)]
    across, down = min(len(places), BESIDE), len(names) * len(bands)
    values = {each: sorted(metrics[each].dropna().astype(int).unique()) for each in set(columns.values())}
    shared = {"sharex": "col" if len(bands) == 1 else False, "sharey": "row"}
    figure, grid = panels(down, across, (3.4 * across, 2.8 * down), **shared)
    for row, (band, name) in zip(grid, itertools.product(bands, names), strict=True):
        for axes, place in itertools.zip_longest(row, band):
            if place is None:
                axes.set_axis_off()
                continue
            rows = metrics[metrics[panel] == place].dropna(subset=[name])
            _lines(axes, rows, name, columns[name], values[columns[name]])
            axes.set_title(readable(place), fontsize=9)
            axes.xaxis.set_major_formatter(EngFormatter(sep=""))
            if name == names[-1]:
                axes.set_xlabel("environment steps")
        row[0].set_ylabel(readable(name))
        _legend(row)
        if metrics[name].dropna().between(0, 1).all():
            row[0].set_ylim(-0.02, 1.04)  # shares have one scale
    return figure


def ablation_curves(metrics: pd.DataFrame, column: str = "success_rate") -> Figure:
    """A logged column while skills were fine-tuned, mean over seeds: panels by task and skill, lines by variant.

    Raises:
        ValueError: if no run has logged the column.
    """
    if not len(metrics):
        return message(f"no table yet: {command(metrics.attrs['ablation'])}")
    if column not in metrics:
        raise ValueError(f"nothing logged {column!r}; there are {', '.join(metrics.columns)}")
    tasks, skills = sorted(metrics["task"].unique()), sorted(metrics["skill"].unique())
    drawn = set(metrics.dropna(subset=[column])["variant"])
    order = [name for name in metrics["variant"].cat.categories if name in drawn]
    figure, grid = panels(len(tasks), len(skills), (3.6 * len(skills), 3.2 * len(tasks)), sharey=True)
    for (task, skill), part in metrics.groupby(["task", "skill"]):
        axes = grid[tasks.index(task), skills.index(skill)]
        for name, rows in part.dropna(subset=[column]).groupby("variant", observed=True):
            mean = rows.groupby("env_steps")[column].mean()
            style = {"marker": ".", "linewidth": 1, **_line(order.index(name))}
            axes.plot(mean.index, mean, label=readable(name), **style)
        axes.set(title=f"{task}: skill {int(skill) + 1}", xlabel="environment steps")
        axes.set_ylabel(readable(column))
    _legend(grid.flat)
    return figure
