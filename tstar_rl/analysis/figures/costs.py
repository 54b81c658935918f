"""What the arms of an experiment cost, and what they give."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter

from tstar_rl.analysis.experiments import arm_table
from tstar_rl.analysis.figures.panels import arm_dots, arm_legend, panels, readable
from tstar_rl.analysis.turns import steps_of_trials

__all__ = ["cost_figure", "steps_of_arms"]


def steps_of_arms(rows: pd.DataFrame, metrics: pd.DataFrame) -> pd.Series:
    """Environment steps of each arm, mean over seeds: its skills', those it learned from after them, and its trials'.

    The episodes before the first turn (chain.seed_episodes) are counted with the trials, but not in the runs published
    so far, which have not logged them.

    Args:
        rows: see `experiments.arm_table`, with a column env_steps.
        metrics: of `read_metrics`; an arm without trials in it has none, and costs none.
    """
    trials = steps_of_trials(metrics, rows["task"].iloc[0])
    learned = rows.groupby("arm", sort=False)["env_steps"].mean()
    return learned.add(trials.reindex(learned.index).fillna(0))


SEEDS = {"marker": ".", "linestyle": "", "markersize": 4, "alpha": 0.5}
"""Dots of an arm's seeds."""


def cost_figure(rows: pd.DataFrame, metrics: pd.DataFrame, labels: Mapping[str, str] | None = None) -> Figure:
    """Progress of each arm of a task, with its interval, against its environment steps, see `steps_of_arms`.

    A small dot is a seed; all stand at the arm's mean of steps.

    Args:
        rows: see `steps_of_arms`.
        metrics: see `steps_of_arms`.
        labels: of arms, also of those that are not drawn here: an arm looks as its place among them says.
    """
    order = list(labels or dict.fromkeys(rows["arm"]))
    figure, grid = panels(1, 1, (11, 4.2))
    axes, steps = grid[0, 0], steps_of_arms(rows, metrics)
    for arm, row in arm_table(rows).iterrows():
        ends = [[row["progress"] - row["progress_low"]], [row["progress_high"] - row["progress"]]]
        style = arm_dots(order.index(str(arm))) | {
            "linestyle": "",
            "capsize": 3,
            "markersize": 7,
            "alpha": 0.85,
        }
        name = f"{(labels or {}).get(str(arm), readable(arm))}: {row['seeds']:.0f}"
        axes.errorbar(steps[arm], row["progress"], yerr=np.clip(ends, 0, None), label=name, **style)
        seeds = rows.loc[rows["arm"] == arm, "progress"]
        axes.plot([steps[arm]] * len(seeds), seeds, color=style["color"], **SEEDS)
    axes.set(xlabel="environment steps: skills, fine-tuning and trials", ylabel="progress", ylim=(0, 1.02))
    axes.xaxis.set_major_formatter(EngFormatter(sep=""))
    axes.set_xlim(left=0)
    arm_legend(axes)
    return figure
