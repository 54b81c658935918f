"""Whether the chains of an experiment get worse with time, as a table of the page."""

import pandas as pd

from tstar_rl.analysis.differences import signed_interval
from tstar_rl.analysis.late_trials import late_trials
from tstar_rl.analysis.page.markdown import Paper, arm_label, arm_order, table

__all__ = ["trials_over_time"]

SAID = """\
Progress in the trial after a chain's last round less that after earlier rounds: mean over seeds with Student's
interval. The highest of several noisy trials is too high, so what is less the best before it is too low; what is less
one trial alone is not.
"""


def trials_over_time(metrics: pd.DataFrame, paper: Paper, task: str, earlier: int | None) -> str:
    """A line for each arm; nothing if no earlier round was declared to count, or no chain came as far."""
    found = pd.DataFrame() if earlier is None else late_trials(metrics, task, earlier)
    if earlier is None or found.empty:
        return ""
    rows = []
    for arm in arm_order(paper, found.index):
        row = found.loc[arm]
        changes = [_change(row[name], row[f"{name}_half"]) for name in ("since_best", "since")]
        numbers = [f"{row['seeds']:.0f}", f"{row['rounds']:.0f}", f"{row['last']:.3f}"]
        rows.append([arm_label(paper, arm), *numbers, *changes])
    header = [
        "arm",
        "seeds",
        "rounds",
        "last trial",
        "less the best before it",
        f"less that of round {earlier}",
    ]
    return f"{SAID}\n{table(header, rows)}"


def _change(mean: float, half: float) -> str:
    return signed_interval(mean, mean - half, mean + half)
