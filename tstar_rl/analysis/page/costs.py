"""What the arms of an experiment cost beside what they give, as a part of the page."""

from pathlib import Path

import pandas as pd

from tstar_rl.analysis.experiments import Experiment
from tstar_rl.analysis.figures import cost_figure, save_figure
from tstar_rl.analysis.page.contents import Entry
from tstar_rl.analysis.page.experiment import ordered
from tstar_rl.analysis.page.markdown import Paper, arm_label, picture
from tstar_rl.analysis.turns import turn_table

__all__ = ["costs", "draw_costs"]

COST = (
    "Progress with its 95% interval, a small dot for each seed, against environment steps: of skills, of fine-tuning "
    "and of trials after turns. "
    "The episodes of a chain before its first turn (chain.seed_episodes) are counted from experiment 0010 on."
)


def costs(metrics: pd.DataFrame, task: str, prefix: str) -> str:
    """The figure; nothing where no chain was fine-tuned or the steps of trials were not logged."""
    return picture(COST, f"{prefix}{task}_costs") if _are_known(metrics, task) else ""


def draw_costs(
    experiment: Experiment, metrics: pd.DataFrame, paper: Paper, entry: Entry, task: str, figures: Path
) -> list[Path]:
    """Writes the figure that `costs` shows, if it shows one: of the entry's `figure_arms`, if any, or of all."""
    if not _are_known(metrics, task):
        return []
    rows = ordered(experiment, paper, task)
    called = {arm: arm_label(paper, arm) for arm in rows["arm"]}
    chosen = rows[rows["arm"].isin(entry.figure_arms)]
    rows = chosen if len(chosen) else rows
    return [save_figure(cost_figure(rows, metrics, called), figures / f"{entry.prefix}{task}_costs.png")]


def _are_known(metrics: pd.DataFrame, task: str) -> bool:
    turns = turn_table(metrics, task)
    return len(turns) > 0 and bool(turns["trial_steps"].notna().all())
