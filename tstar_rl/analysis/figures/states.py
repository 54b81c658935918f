"""Where skills end and begin: terminal states and hand-overs."""

from collections.abc import Sequence
from textwrap import fill

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from tstar_rl.analysis.figures.panels import COLOURS, message, panels, readable

__all__ = ["hand_over_matrix", "reliability_figure", "terminal_state_plane"]


def terminal_state_plane(table: pd.DataFrame, shares: Sequence[float]) -> Figure:
    """Terminal states in the plane of `terminal_states.add_plane`: a panel a system, coloured by progress of training.

    Args:
        table: with columns system, x, y, progress.
        shares: (2,) of the variance, of the two components.
    """
    systems = list(dict.fromkeys(table["system"]))
    figure, grid = panels(1, len(systems), (4.6 * len(systems), 4), sharex=True, sharey=True)
    points = None
    for axes, system in zip(grid[0], systems, strict=True):
        rows = table[table["system"] == system]
        points = axes.scatter(rows.x, rows.y, c=rows.progress, s=8, cmap="viridis", vmin=0, vmax=1)
        axes.set(title=readable(system), xlabel=f"component 1 ({shares[0]:.0%})")
        axes.locator_params(nbins=5)
    grid[0][0].set_ylabel(f"component 2 ({shares[1]:.0%})")
    if points is not None:
        figure.colorbar(points, ax=grid[0].tolist(), label="progress of training")
    return figure


def hand_over_matrix(table: pd.DataFrame) -> Figure:
    """Success of each skill from its own starts and from where the one before ends, mean over seeds.

    Args:
        table: rows of hand_over.csv of one task and checkpoint.
    """
    systems, subtasks = list(dict.fromkeys(table["system"])), sorted(table["subtask"].unique())
    size = (2.2 + 1.7 * len(subtasks), 1.4 + 0.5 * len(systems))
    figure, grid = panels(1, 2, size, sharey=True)
    titles = {"own_starts": "from its own starts", "handed_over": "from where the one before ends"}
    for axes, (column, title) in zip(grid[0], titles.items(), strict=True):
        axes.grid(False)
        mean = table.pivot_table(index="system", columns="subtask", values=column, dropna=False)
        values = mean.reindex(index=systems, columns=subtasks).to_numpy(dtype=float)
        axes.imshow(values, vmin=0, vmax=1, cmap="RdYlGn", aspect="auto")
        for row in range(len(systems)):
            for place in range(len(subtasks)):
                number = values[row, place]
                axes.text(place, row, "" if number != number else f"{number:.2f}", ha="center", va="center")
        axes.set_title(title, fontsize=9)
        axes.set_xticks(range(len(subtasks)), [f"skill {index + 1}" for index in subtasks])
        axes.set_yticks(range(len(systems)), [readable(name) for name in systems])
    return figure


ACROSS = 3
"""Panels side by side."""


def reliability_figure(table: pd.DataFrame) -> Figure:
    """What signals said of the states that were handed over, against what then happened: a panel a signal.

    A point is a bin of scores, its area the number of states; on the diagonal a score is a probability.

    Args:
        table: rows of `tables.read_calibration`.
    """
    if table.empty:
        return message("no calibration.csv yet: a recipe with a signal writes it")
    signals = list(dict.fromkeys(table["signal"]))
    colours = {skill: COLOURS[i % len(COLOURS)] for i, skill in enumerate(sorted(set(table["skill"])))}
    columns = min(len(signals), ACROSS)
    rows_of_panels = -(-len(signals) // columns)
    size = (3.6 * columns, 3.6 * rows_of_panels)
    figure, grid = panels(rows_of_panels, columns, size, sharex=True, sharey=True)
    places: list[Axes] = grid.ravel().tolist()
    for axes in places[len(signals) :]:
        axes.set_axis_off()
    for axes, signal in zip(places, signals, strict=False):
        rows = table[table["signal"] == signal]
        for skill, own in rows.groupby("skill"):
            areas = 120 * own["states"] / rows["states"].max()
            axes.scatter(own["score"], own["outcome"], s=areas, alpha=0.6, color=colours[skill])
        axes.plot([0, 1], [0, 1], color="0.5", linewidth=0.8)
        axes.set(xlabel="said", xlim=(-0.03, 1.03), ylim=(-0.03, 1.03))
        axes.set_title(fill(readable(signal), 42), fontsize=9)
    for line in grid:
        line[0].set_ylabel("happened")
    keys = [
        Line2D([], [], linestyle="", marker="o", color=colour, label=f"after skill {int(skill) + 1}")
        for skill, colour in colours.items()
    ]
    grid[0][0].legend(handles=keys, fontsize=7)
    return figure
