"""The turns of an experiment's chains as a table of the page."""

import math

import pandas as pd

from tstar_rl.analysis.page.markdown import NOTHING, Paper, arm_label, arm_order, table
from tstar_rl.analysis.turns import turn_table

__all__ = ["turns"]

SAID = """\
Means over seeds. Progress is that of the chain that goes on, in the trials after its turns: of two arms with the same
end, the one that rose earlier has more. AUC: how well the signal that paid a skill tells whether the next one then
succeeded (.5: nothing).
"""


def turns(metrics: pd.DataFrame, paper: Paper, task: str) -> str:
    """A line for each arm that was trained; nothing if none was."""
    found = turn_table(metrics, task)
    if found.empty:
        return ""
    rows = []
    for arm in arm_order(paper, found.index):
        row = found.loc[arm]
        numbers = [f"{row['trial_progress']:.3f}", _share(row["kept"]), _share(row["auc"])]
        steps = NOTHING if math.isnan(row["trial_steps"]) else f"{row['trial_steps'] / 1e6:.2f}M"
        rows.append([arm_label(paper, arm), f"{row['seeds']:.0f}", f"{row['turns']:.0f}", *numbers, steps])
    header = [
        "arm",
        "seeds",
        "turns",
        "progress in trials, mean over turns",
        "turns kept",
        "AUC of the signal",
    ]
    return f"{SAID}\n{table([*header, 'steps of trials'], rows)}"


def _share(value: float) -> str:
    return NOTHING if math.isnan(value) else f"{value:.2f}"
