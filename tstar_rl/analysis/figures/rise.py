"""How fast the arms of an experiment rise while their chains are fine-tuned."""

from collections.abc import Mapping

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from tstar_rl.analysis.figures.panels import arm_dots, arm_legend, arm_line, message, panels, readable
from tstar_rl.analysis.turns import tried_turns

__all__ = ["rise_figure"]

MANY = 20
"""Trials of a chain from which on only every so many-th has a marker."""
SHARES = (1 / 8, 1 / 4, 1 / 2, 1)


def rise_figure(metrics: pd.DataFrame, task: str, labels: Mapping[str, str] | None = None) -> Figure:
    """Progress of the chain in the trials that follow turns, against environment steps learned from.

    A thin line is a seed. A thick one is the mean of their n-th trials, as far as all seeds of the arm have come. Where
    trials are many, vertical lines stand at an eighth, a quarter, half and all of the steps.

    Args:
        metrics: of `read_metrics`.
        task: of the chains.
        labels: of arms, in their order; without them arms stand in the order of their names. An arm has the colour of
            its place, as in the other figures.
    """
    rows = tried_turns(metrics, task)
    if rows.empty:
        return message("no chain was tried after its turns")
    arms = [arm for arm in labels or {} if arm in set(rows["recipe"])] or sorted(set(rows["recipe"]))
    figure, grid = panels(1, 1, (11, 4.5))
    axes = grid[0, 0]
    many = rows.groupby(["recipe", "seed"]).size().max() > MANY
    if many:
        for share in SHARES:
            axes.axvline(share * rows["env_steps"].max(), color="0.85", linewidth=1, zorder=0)
    places = {arm: place for place, arm in enumerate(labels or arms)}
    for arm in arms:
        mine, style = rows[rows["recipe"] == arm], arm_line(places[arm]) | arm_dots(places[arm])
        style |= {"markevery": MANY} if many else {}
        seeds = mine.groupby("seed")
        for _, run in seeds:
            axes.plot(run["env_steps"], run["trial_progress"], color=style["color"], linewidth=0.6, alpha=0.5)
        trials = mine.groupby(seeds.cumcount())[["env_steps", "trial_progress"]]
        mean = trials.mean()[trials.size() == len(seeds)]
        name = f"{(labels or {}).get(arm, readable(arm))}: {len(seeds)}"
        axes.plot(mean["env_steps"], mean["trial_progress"], linewidth=2.2, markersize=5, label=name, **style)
    axes.set(xlabel="environment steps learned from", ylabel="progress in trials", ylim=(None, 1.01))
    axes.xaxis.set_major_formatter(EngFormatter(sep=""))
    arm_legend(axes)
    return figure
