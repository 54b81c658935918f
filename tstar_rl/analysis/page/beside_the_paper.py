"""Runs of several experiments beside the paper's Table 1, for the notes."""

from collections.abc import Sequence

import pandas as pd

from tstar_rl.analysis.experiments import Experiment
from tstar_rl.analysis.page.contents import Entry
from tstar_rl.analysis.page.markdown import Paper, labels, mean_and_half, millions, table, theirs
from tstar_rl.analysis.page.sections import pick
from tstar_rl.analysis.tables import evaluations_of, whole_task

__all__ = ["beside_the_paper"]

SAME = {"gaussian": "policy_sequencing", "spirl_released": "spirl"}
"""Arms that the paper's table has under another name."""


def beside_the_paper(
    experiment: Experiment, paper: Paper, entry: Entry, task: str, folders: Sequence[str]
) -> str:
    """A line for each system that was run: the paper's progress and success, and ours of the last and the best.

    Args:
        experiment: of chains.
        paper: with the paper's figures.
        entry: of the experiment.
        task: one of the experiment's.
        folders: of experiments beside it whose systems stand in the same table.
    """
    whole = pd.concat(
        [
            whole_task(evaluations_of(entry.folder.parent / each), task)
            for each in (*folders, entry.folder.name)
        ]
    )
    lines = []
    for system, label in labels(paper, whole["recipe"]).items():
        last, best = (pick(whole, system, checkpoint) for checkpoint in ("last", "best"))
        if last.empty:
            continue
        line = [label, *theirs(paper, SAME.get(system, system), task)]
        line += [
            mean_and_half(last["progress"], 2),
            mean_and_half(last["success"], 2),
            mean_and_half(best["progress"], 2),
        ]
        lines.append([*line, str(last["seed"].nunique()), millions(last["env_steps"].mean())])
    header = [
        "system",
        "paper: progress +- deviation",
        "success",
        "ours, last: progress [Student's 95%]",
        "success",
    ]
    return table([*header, "ours, best: progress", "seeds", "steps learned from"], lines)
