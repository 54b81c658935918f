"""What decides at each seam, how far skills move it, what it costs them, and whether it is kept: one figure."""

from collections.abc import Mapping

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tstar_rl.analysis.figures.panels import arm_dots, message, panels, readable

__all__ = ["anatomy_figure"]

SHOWN = 4
"""Groups of inputs in a panel: those that decide most."""
TITLES = {
    "off": "how far off it is",
    "next_success": "the next skill succeeds",
    "own_success": "its own success, alone",
    "kept": "its turns that were kept",
}


def _decides(axes: Axes, falls: pd.DataFrame) -> None:
    """A bar for each of the groups that decide most, a dot for each seed."""
    mean = falls.mean().sort_values(ascending=False).head(SHOWN)
    axes.barh(range(len(mean)), mean, color="0.8", zorder=1)
    for place, group in enumerate(mean.index):
        axes.scatter(falls[group], [place] * len(falls), s=9, color="0.3", linewidths=0, zorder=2)
    axes.set_yticks(range(len(mean)), [readable(group) for group in mean.index], fontsize=8)
    axes.invert_yaxis()


def _chains(axes: Axes, rows: pd.DataFrame, what: str, systems: Mapping[str, str]) -> None:
    """A line of dots for each system, one a seed, with their mean."""
    for place, system in enumerate(systems):
        values = rows.loc[rows["system"] == system, what].dropna()
        if len(values):
            axes.scatter(values, [place] * len(values), s=14, linewidths=0, alpha=0.7, **arm_dots(place))
            axes.plot([values.mean()] * 2, [place - 0.3, place + 0.3], color="black", linewidth=1.6)
    axes.set_ylim(len(systems) - 0.5, -0.5)
    axes.set_yticks(range(len(systems)), [])


def anatomy_figure(falls: pd.DataFrame, table: pd.DataFrame, systems: Mapping[str, str]) -> Figure:
    """A row of panels for each seam, left to right: what decides, how far off it is, who succeeds, what is kept.

    Skills are counted from one. A dot is a seed, a bar or a black line a mean. In the second panel a dashed line says
    how far off the next skill's own starts are: what it saw. Chains without a gate have no panel of turns kept.

    Args:
        falls: of `deciding_inputs`.
        table: of `seam_anatomy`.
        systems: those to show, and what each is called.
    """
    seams = sorted(set(table["subtask"])) if len(table) else []
    if not seams:
        return message("no seams yet: python recipes/hand_over_gap.py")
    titles = {what: title for what, title in TITLES.items() if table[what].notna().any()}
    columns = 1 + len(titles)
    figure, grid = panels(len(seams), columns, (2.5 * columns, 0.9 + 1.5 * len(seams)))
    for line, seam in zip(grid, seams, strict=True):
        rows = table[table["subtask"] == seam]
        by, saw = rows["by"].iloc[0], rows["saw"].mean()
        _decides(line[0], falls.loc[seam])
        line[0].set_title(f"skill {seam} hands over to {seam + 1}: what decides", fontsize=8)
        line[0].set_xlabel("AUC falls by, if shuffled", fontsize=8)
        for axes, (what, title) in zip(line[1:], titles.items(), strict=True):
            _chains(axes, rows, what, systems)
            axes.set_title(title, fontsize=8)
            axes.tick_params(axis="x", labelsize=8)
        line[1].axvline(saw, color="0.3", linestyle="--", linewidth=1)
        line[1].set_xlim(left=0)
        unit = "m" if by.endswith(" position") else "degrees"
        line[1].set_xlabel(f"{readable(by)}: {unit} off own starts", fontsize=8)
        line[1].set_yticks(range(len(systems)), list(systems.values()), fontsize=8)
        for axes in line[2:]:
            axes.set_xlim(-0.03, 1.03)
    return figure
