"""How fast the arms of an experiment rise while their chains are fine-tuned."""

from collections.abc import Mapping

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from tstar_rl.analysis.figures.panels import arm_dots, arm_legend, arm_line, message, panels, readable
from tstar_rl.analysis.turns import tried_turns

__all__ = ["rise_figure"]


def rise_figure(metrics: pd.DataFrame, task: str, labels: Mapping[str, str] | None = None) -> Figure:
    """Progress of the chain in the trial after each turn, against environment steps learned from.

    A thin line is a seed, a thick one the mean over those that came as far as all others of the arm.

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
    places = {arm: place for place, arm in enumerate(labels or arms)}
    for arm in arms:
        seeds = rows[rows["recipe"] == arm].pivot(index="env_steps", columns="seed", values="trial_progress")
        mean, style = seeds.dropna().mean(axis=1), arm_line(places[arm]) | arm_dots(places[arm])
        axes.plot(seeds.index, seeds, color=style["color"], linewidth=0.6, alpha=0.5)
        name = f"{(labels or {}).get(arm, readable(arm))}: {seeds.shape[1]}"
        axes.plot(mean.index, mean, linewidth=2.2, markersize=5, label=name, **style)
    axes.set(xlabel="environment steps learned from", ylabel="progress in trials", ylim=(None, 1.01))
    axes.xaxis.set_major_formatter(EngFormatter(sep=""))
    arm_legend(axes)
    return figure
