"""What the signals of an experiment told of the next skill's outcomes, turn by turn."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from tstar_rl.analysis.differences import student_half
from tstar_rl.analysis.figures.arms import name_rows
from tstar_rl.analysis.figures.panels import COLOURS, MARKERS, arm_dots, message, panels

__all__ = ["signals_figure"]

MEASURES = {"auc": "AUC (.5 is chance)", "spread": "deviation of the scores"}
SIDEWARDS = 0.3
"""How far the dots of a row lie from its middle at most."""


def signals_figure(turns: pd.DataFrame, labels: Mapping[str, str]) -> Figure:
    """AUC and spread of each arm's signal: a column of panels for each seam, a dot for each turn of a seed.

    A dot's colour is the round, with more than seven from dark to light; it is hollow where the gate put the turn back.
    A bar below is the mean over seeds of their kept turns, with Student's 95% interval.

    Args:
        turns: of `turns.signal_turns`.
        labels: what each of its signals is called, from top to bottom.
    """
    if turns.empty:
        return message("no signal was judged")
    skills, rounds = sorted(set(turns["skill"])), sorted(set(turns["round"]))
    figure, grid = panels(
        len(MEASURES),
        len(skills),
        (2.2 + 2.8 * len(skills), 2.2 + 0.5 * len(MEASURES) * len(labels)),
        sharex="row",
    )
    for line, (measure, said) in zip(grid, MEASURES.items(), strict=True):
        for axes, skill in zip(line, skills, strict=True):
            _panel(axes, turns[turns["skill"] == skill], measure, list(labels), rounds)
            axes.set_title(f"skill {skill + 1} hands over to {skill + 2}", fontsize=9)
            axes.set_xlabel(said, fontsize=8)
            name_rows(axes, list(labels.values()) if axes is line[0] else [""] * len(labels), fontsize=8)
        line[0].set_xlim(0, 1.02 if measure == "auc" else None)
    few = len(rounds) <= len(COLOURS)
    shown = rounds if few else [rounds[0], rounds[len(rounds) // 2], rounds[-1]]
    keys = [
        Line2D([], [], label=f"round {number + 1}", linestyle="", **_dot(rounds, number)) for number in shown
    ]
    if not turns["kept"].all():
        hollow = {**_dot(rounds, rounds[0]), "markerfacecolor": "none"}
        keys.append(Line2D([], [], label="put back", linestyle="", **hollow))
    figure.legend(handles=keys, loc="outside lower center", ncols=len(keys), fontsize=8)
    return figure


def _dot(rounds: list[int], number: int) -> dict[str, Any]:
    """Colour and marker of a round's turns: of its own, or, of more rounds than there are colours, on a scale."""
    place = rounds.index(number)
    if len(rounds) <= len(COLOURS):
        return arm_dots(place)
    return {"color": to_hex(colormaps["viridis"](0.9 * place / (len(rounds) - 1))), "marker": MARKERS[0]}


def _panel(axes: Axes, turns: pd.DataFrame, measure: str, signals: list[str], rounds: list[int]) -> None:
    if measure == "auc":
        axes.axvline(0.5, color="black", linewidth=0.8)
    for place, signal in enumerate(signals):
        mine = turns[(turns["signal"] == signal) & turns[measure].notna()]
        for number, those in mine.groupby("round"):
            offsets = np.linspace(-SIDEWARDS, 0.05, len(those)) if len(those) > 1 else [0.0]
            style = _dot(rounds, int(str(number)))
            for value, offset, kept in zip(those[measure], offsets, those["kept"], strict=True):
                face = style["color"] if kept else "none"
                axes.plot(
                    value,
                    place + offset,
                    **style,
                    linestyle="",
                    markersize=4,
                    alpha=0.75,
                    markerfacecolor=face,
                )
        of_seeds = mine[mine["kept"]].groupby("seed")[measure].mean().to_numpy()
        if len(of_seeds):
            half = np.nan_to_num(student_half(of_seeds))
            style = {"fmt": "|", "color": "black", "capsize": 3, "markersize": 8}
            axes.errorbar(of_seeds.mean(), place + 0.25, xerr=half, **style)
