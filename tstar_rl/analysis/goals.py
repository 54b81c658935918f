"""Levels that an experiment set itself before its runs, and how far its arms get."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from tstar_rl.analysis.experiments import Experiment, arm_table
from tstar_rl.analysis.statistics import probability_of_improvement

__all__ = ["Goals", "goal_levels"]


@dataclass(frozen=True)
class Goals:
    """Declared before the runs: what an arm's last checkpoint should reach."""

    progress: float
    """Deterministic, as the next one; interquartile means over seeds."""
    success: float
    """Of the whole task."""
    sampled: float
    """Progress with sampled actions."""
    improvement: float
    """Probability of improvement over each arm of `over`."""
    over: tuple[str, ...]

    def levels(self) -> dict[str, float]:
        """What each column of `goal_levels` should reach."""
        return {
            "progress": self.progress,
            "success": self.success,
            "sampled": self.sampled,
            **dict.fromkeys(self.over, self.improvement),
        }


def goal_levels(experiment: Experiment, goals: Goals, task: str) -> pd.DataFrame:
    """How far each arm gets.

    Returns:
        Index arm; the columns of `Goals.levels`: of an arm of `over` the probability of improvement over it, nan where
        the two share no seed (sampled: where nothing was); and seeds, env_steps (mean over seeds).
    """
    rows, sampled = (experiment.chosen(task, "last", mode) for mode in ("deterministic", "stochastic"))
    found, noisy = arm_table(rows), arm_table(sampled)
    levels = found[["progress", "success"]].assign(sampled=noisy.get("progress", pd.Series(dtype=float)))
    of_seeds = {arm: mine.set_index("seed")["progress"] for arm, mine in rows.groupby("arm")}
    for over in goals.over:
        levels[over] = [_improvement(of_seeds, str(arm), over) for arm in found.index]
    return levels.assign(seeds=found["seeds"], env_steps=rows.groupby("arm")["env_steps"].mean())


def _improvement(of_seeds: Mapping[str, pd.Series], arm: str, over: str) -> float:
    """On the seeds that both arms have."""
    shared = of_seeds[arm].index.intersection(of_seeds[over].index) if over in of_seeds else []
    if arm == over or not len(shared):
        return math.nan
    return float(probability_of_improvement(of_seeds[arm][shared], of_seeds[over][shared]))
