"""Pictures of results: curves, the plane of terminal states, and the hand-over matrix. Each writes a PNG."""

from collections.abc import Mapping
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import pandas as pd
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

__all__ = ["hand_over_matrix", "seed_curves", "terminal_state_plane"]


def _write(figure: Figure, path: str | Path) -> Path:
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    plt.close(figure)
    return Path(path)


def _lines(axes: Axes, rows: pd.DataFrame, column: str, colour: str) -> None:
    """A line for each run in `rows`, in pieces where it does not train the same skill all the time."""
    labelled = set()
    pieces = [colour] if colour == "seed" else [colour, "seed", "round"]
    for place, run in rows.groupby(pieces):
        value = int(place[0])  # pyright: ignore[reportGeneralTypeIssues]
        label = None if value in labelled else f"{colour} {value}"
        labelled.add(value)
        style = {"color": f"C{value}", "marker": ".", "markersize": 3, "linewidth": 1}
        axes.plot(run.env_steps, run[column], label=label, **style)


def seed_curves(metrics: pd.DataFrame, path: str | Path, columns: Mapping[str, str], panel: str) -> Path:
    """Logged columns against environment steps: a row of panels for each column, thin lines are seeds.

    Args:
        metrics: from `plotting.read_metrics`.
        path: of the PNG.
        columns: each with what has a colour: "seed" or, of a chain, "skill". Those that no run has logged are left out.
        panel: column whose values have a panel each, in the order of their first rows.
    """
    names = [name for name in columns if name in metrics and metrics[name].notna().any()]
    places = list(dict.fromkeys(metrics[panel]))
    size = (3.4 * len(places), 2.8 * len(names))
    figure, panels = plt.subplots(len(names), len(places), figsize=size, squeeze=False, sharey="row")
    for row, name in zip(panels, names, strict=True):
        for axes, place in zip(row, places, strict=True):
            _lines(axes, metrics[metrics[panel] == place].dropna(subset=[name]), name, columns[name])
            axes.set_title(str(place).replace("_", " "), fontsize=9)
            axes.grid(alpha=0.3)
        row[0].set_ylabel(name.replace("_", " "))
        row[0].legend(fontsize=7)
        values = metrics[name].dropna()
        if values.between(0, 1).all():
            row[0].set_ylim(-0.02, 1.04)  # shares: the same scale whatever they are
    for axes in panels[-1]:
        axes.set_xlabel("environment steps")
        axes.xaxis.set_major_formatter(EngFormatter(sep=""))
    figure.tight_layout()
    return _write(figure, path)


def terminal_state_plane(table: pd.DataFrame, shares: list[float], path: str | Path) -> Path:
    """Terminal states in the plane of `terminal_states.add_plane`: a panel a system, coloured by progress."""
    systems = list(dict.fromkeys(table["system"]))
    figure, panels = plt.subplots(
        1, len(systems), figsize=(4.6 * len(systems), 4), squeeze=False,
        sharex=True, sharey=True, layout="constrained",
    )  # fmt: skip
    points = None
    for axes, system in zip(panels[0], systems, strict=True):
        rows = table[table["system"] == system]
        points = axes.scatter(rows.x, rows.y, c=rows.progress, s=8, cmap="viridis", vmin=0, vmax=1)
        axes.set(title=str(system).replace("_", " "), xlabel=f"component 1 ({shares[0]:.0%})")
        axes.locator_params(nbins=5)
        axes.grid(alpha=0.3)
    panels[0][0].set_ylabel(f"component 2 ({shares[1]:.0%})")
    if points is not None:
        figure.colorbar(points, ax=panels[0].tolist(), label="progress of training")
    return _write(figure, path)


def hand_over_matrix(table: pd.DataFrame, path: str | Path) -> Path:
    """Success of each skill from its own starts and from where the one before ends, mean over seeds."""
    systems, subtasks = list(dict.fromkeys(table["system"])), sorted(table["subtask"].unique())
    figure, panels = plt.subplots(
        1, 2, figsize=(2.2 + 1.7 * len(subtasks), 1.4 + 0.5 * len(systems)), sharey=True
    )
    titles = {"own_starts": "from its own starts", "handed_over": "from where the one before ends"}
    for axes, (column, title) in zip(panels, titles.items(), strict=True):
        mean = table.pivot_table(index="system", columns="subtask", values=column, dropna=False)
        values = mean.reindex(index=systems, columns=subtasks).to_numpy(dtype=float)
        axes.imshow(values, vmin=0, vmax=1, cmap="RdYlGn", aspect="auto")
        for row in range(len(systems)):
            for place in range(len(subtasks)):
                number = values[row, place]
                axes.text(place, row, "" if number != number else f"{number:.2f}", ha="center", va="center")
        axes.set_title(title, fontsize=9)
        axes.set_xticks(range(len(subtasks)), [f"skill {index}" for index in subtasks])
        axes.set_yticks(range(len(systems)), [str(name).replace("_", " ") for name in systems])
    figure.tight_layout()
    return _write(figure, path)
