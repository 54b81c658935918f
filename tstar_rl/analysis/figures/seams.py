"""Who mended the seams of chains: the skill that hands over, or the one that takes over."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from tstar_rl.analysis.differences import outer_ends
from tstar_rl.analysis.figures.arms import draw_dots, draw_interval, name_rows
from tstar_rl.analysis.figures.panels import COLOURS, MARKERS, message, panels, readable

__all__ = ["effects_figure", "exchanged_figure"]

VERSIONS = ("before", "after")
SHADES = {"before": "0.6", "after": COLOURS[0]}
WIDTH = 0.38


def _panel(axes: Axes, rows: pd.DataFrame, seeds: list[int]) -> None:
    """Groups: the second skill before and after. In each a bar for the first one before and after.

    Of several seeds a bar is the mean, and a line joins the two dots of a seed: what exchanging its first skill does.
    """
    for group, taken_by in enumerate(VERSIONS):
        here = rows[rows["taken_by"] == taken_by].dropna(subset="success")
        places = {version: group + (side - 0.5) * WIDTH for side, version in enumerate(VERSIONS)}
        for handed_by, there in here.groupby("handed_by"):
            place, mean = places[str(handed_by)], there["success"].mean()
            colour, label = SHADES[str(handed_by)], f"first skill as {handed_by}"
            axes.bar(
                place, mean, WIDTH * 0.92, color=colour, label=label, alpha=0.45 if len(seeds) > 1 else 1.0
            )
            axes.annotate(f"{mean:.2f}", (place, 0.02), ha="center", fontsize=7)
            if len(seeds) == 1:
                ends = [[mean - there["success_low"].iloc[0]], [there["success_high"].iloc[0] - mean]]
                axes.errorbar(place, mean, yerr=np.clip(ends, 0, None), fmt="none", color="black", capsize=3)
        for number, seed in enumerate(seeds if len(seeds) > 1 else []):
            own = here[here["seed"] == seed].set_index("handed_by")["success"]
            style = {
                "marker": MARKERS[number % len(MARKERS)],
                "color": "black",
                "markersize": 4,
                "linewidth": 0.9,
            }
            axes.plot([places[str(version)] for version in own.index], own, label=f"seed {seed}", **style)


def effects_figure(effects: pd.DataFrame, by_seed: pd.DataFrame, words: Mapping[str, str]) -> Figure:
    """What either skill of each seam adds to the second one's success: a panel for each effect, a dot for each seed.

    Args:
        effects: of `exchanged.exchange_effects`.
        by_seed: of `exchanged.effects_of_seeds`.
        words: the effects that are shown, from left to right, and what each is called.
    """
    seams = sorted(set(effects["subtask"]))
    figure, (line,) = panels(
        1, len(words), (4.2 * len(words), 1.3 + 0.6 * len(seams)), sharex=True, sharey=True
    )
    for axes, (effect, said) in zip(line, words.items(), strict=True):
        axes.axvline(0, color="black", linewidth=0.8)
        for place, seam in enumerate(seams):
            dots, found = (
                each[(each["subtask"] == seam) & (each["effect"] == effect)] for each in (by_seed, effects)
            )
            draw_dots(axes, dots["value"], place, {"color": COLOURS[0], "marker": "o"})
            mean = float(found["value"].iloc[0])
            low, high = outer_ends(mean, *(float(found[name].iloc[0]) for name in ("low", "high", "t_half")))
            draw_interval(axes, pd.Series({"": mean, "_low": low, "_high": high}), "", place)
        axes.set_title(said, fontsize=9)
        axes.set_xlabel("the second skill succeeds more often by", fontsize=8)
        name_rows(axes, [f"skill {seam} hands over to {seam + 1}" for seam in seams], fontsize=8)
    return figure


def exchanged_figure(table: pd.DataFrame) -> Figure:
    """Success of the second skill of each seam when one or both skills are exchanged for what they were before.

    A row of panels for each system, a column for each seam. One chain: bars with 95% intervals. Several seeds: means,
    and a line for each.

    Args:
        table: rows of `exchanged.csv`, of one task and one checkpoint.
    """
    if table.empty:
        return message("no table yet: python recipes/exchanged.py")
    systems, seams = list(dict.fromkeys(table["system"])), sorted(set(table["subtask"]))
    seeds = sorted(set(table["seed"]))
    figure, grid = panels(
        len(systems), len(seams), (2.9 * len(seams), 0.5 + 2.1 * len(systems)), sharey=True, sharex=True
    )
    for line, system in zip(grid, systems, strict=True):
        for axes, seam in zip(line, seams, strict=True):
            _panel(axes, table[(table["system"] == system) & (table["subtask"] == seam)], seeds)
            axes.set_title(f"{readable(system)}: skill {seam} hands over to {seam + 1}", fontsize=8)
            axes.set_xticks([0, 1], [f"second skill\nas {version}" for version in VERSIONS], fontsize=8)
            axes.set_ylim(0, 1.02)
        line[0].set_ylabel("the second skill succeeds")
    drawn = [axes.get_legend_handles_labels() for line in grid for axes in line]
    known = {
        label: handle for handles, labels in drawn for label, handle in zip(labels, handles, strict=True)
    }
    figure.legend(known.values(), known.keys(), loc="outside lower center", ncols=6, fontsize=8)
    return figure
