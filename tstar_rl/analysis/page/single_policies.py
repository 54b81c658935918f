"""How far single policies of the whole task get, as a part of the page: every seed, and nothing that is compared."""

import pandas as pd

from tstar_rl.analysis.page.markdown import (
    Paper,
    interval,
    labels,
    mean_and_half,
    millions,
    table,
    theirs,
)
from tstar_rl.analysis.page.sections import pick
from tstar_rl.analysis.tables import whole_task
from tstar_rl.intervals import wilson_interval

__all__ = ["single_policies"]

SAID = """\
Progress of the last checkpoint in deterministic episodes of the whole task. A seed's interval is Wilson's for a share
of as many episodes: a little too wide, since progress also takes values between 0 and 1. The mean over seeds has
Student's t beside it, unless it is of less than six seeds that are all alike. The second table decides nothing.
"""


def single_policies(evaluations: pd.DataFrame, paper: Paper, task: str) -> str:
    """Two tables of the policies of a task: progress of each seed with the paper's, and what else was measured."""
    whole = whole_task(evaluations, task)
    progress, more = [], []
    for system, label in labels(paper, whole["recipe"]).items():
        last = pick(whole, system, "last")
        if last.empty:
            continue
        known = theirs(paper, system, task)[0]
        progress.append([label, known, _of_seeds(last, "progress"), mean_and_half(last["progress"], 3)])
        sampled, best = pick(whole, system, "last", "stochastic"), pick(whole, system, "best")
        line = [
            label,
            _of_seeds(last, "success"),
            mean_and_half(sampled["progress"], 3),
            mean_and_half(best["progress"], 3),
        ]
        more.append([*line, millions(last["env_steps"].mean())])
    if not progress:
        return ""
    first = table(["policy", "paper", "each seed [95%]", "mean +- 95%, Student's t"], progress)
    header = [
        "policy",
        "whole task: success of each seed [95%]",
        "sampled: progress",
        "best checkpoint: progress",
    ]
    return f"{SAID}\n{first}\n{table([*header, 'environment steps'], more)}"


def _of_seeds(rows: pd.DataFrame, name: str) -> str:
    """A share of each seed with its interval."""
    said = []
    for _, row in rows.iterrows():
        low, high = wilson_interval(row[name] * row["episodes"], row["episodes"])
        said.append(f"{row['seed']}: {interval(row[name], low, high)}")
    return "; ".join(said)
