"""A figure with a grid of panels, and writing it as a PNG file."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tstar_rl.runs.files import replacing, turn_to_write

__all__ = [
    "COLOURS",
    "MARKERS",
    "THRESHOLDS",
    "arm_dots",
    "arm_legend",
    "arm_line",
    "draw_profile",
    "message",
    "panels",
    "readable",
    "save_figure",
]

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Told apart with any colour vision. Source: Okabe and Ito, Color Universal Design, 2008."""
LINES = ("-", "--", "-.", ":", (0, (6, 1.5, 1, 1.5, 1, 1.5)))
MARKERS = "os^DvPX<>*"
THRESHOLDS = np.linspace(0, 1, 101)
"""Of a performance profile: values of progress."""


def arm_line(place: int) -> dict[str, Any]:
    """Colour and dashes of the arm in the given place: both differ, so that neither is needed alone."""
    return {"color": COLOURS[place % len(COLOURS)], "linestyle": LINES[place % len(LINES)]}


def arm_dots(place: int) -> dict[str, Any]:
    """Colour and marker of an arm, as in `arm_line`."""
    return {"color": COLOURS[place % len(COLOURS)], "marker": MARKERS[place % len(MARKERS)]}


def draw_profile(
    axes: Axes,
    place: int,
    profile: Sequence[NDArray[np.float64]],
    thresholds: NDArray[np.float64] = THRESHOLDS,
) -> None:
    """A performance profile in the line of an arm.

    Args:
        axes: where.
        place: of the arm.
        profile: share of runs above each threshold, and, where they are drawn, the lower and the upper end of its
            band, each (thresholds,).
        thresholds: values of progress.
    """
    share, *band = profile
    axes.step(thresholds, share, where="post", **arm_line(place))
    if band:
        colour = arm_line(place)["color"]
        axes.fill_between(thresholds, *band, step="post", color=colour, alpha=0.1, linewidth=0)


def arm_legend(axes: Axes) -> None:
    """Names the arms to the right of a panel, where no data is hidden; each label ends with its number of seeds."""
    beside = {"loc": "center left", "bbox_to_anchor": (1.01, 0.5)}
    axes.legend(fontsize=8, title="arm: seeds", title_fontsize=8, **beside)


def panels(
    rows: int, columns: int, size: tuple[float, float], **options: Any
) -> tuple[Figure, NDArray[np.object_]]:
    """A figure of `size` (inches) and its panels, (rows, columns) of `Axes`, each with a grid."""
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, **options)
    for axes in grid.flat:
        axes.grid(alpha=0.3)
        axes.set_axisbelow(True)
    return figure, grid


def save_figure(figure: Figure, path: str | Path, dpi: int = 110) -> Path:
    """Writes a PNG file at once, the same bytes for the same figure; makes its folder."""
    path = Path(path)
    with turn_to_write(path.parent), replacing(path) as partial:
        figure.savefig(partial, format="png", dpi=dpi, metadata={"Software": None})
    return path


def message(text: str) -> Figure:
    """A figure that only says something."""
    figure = Figure(figsize=(7, 1), layout="constrained")
    axes: Axes = figure.subplots()
    axes.text(0.5, 0.5, text, ha="center", va="center")
    axes.set_axis_off()
    return figure


def readable(name: object) -> str:
    """A column's or a system's name as a reader sees it."""
    return str(name).replace("_", " ")
