"""Runs of several experiments beside the paper's Table 1, for the notes."""

from collections.abc import Sequence
from itertools import combinations

import pandas as pd

from tstar_rl.analysis.experiments import Experiment
from tstar_rl.analysis.page.contents import Entry
from tstar_rl.analysis.page.markdown import Paper, labels, mean_and_half, millions, table, theirs
from tstar_rl.analysis.page.sections import pick
from tstar_rl.analysis.tables import evaluations_of, whole_task
from tstar_rl.checks import InvalidValueError

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

    Raises:
        InvalidValueError: if a system is in two of them.
    """
    every = {
        name: whole_task(evaluations_of(entry.folder.parent / name), task)
        for name in (*folders, entry.folder.name)
    }
    for one, other in combinations(every, 2):
        if both := set(every[one]["recipe"]) & set(every[other]["recipe"]):
            raise InvalidValueError(
                f"beside the paper: {', '.join(sorted(both))} is in {one} and in {other}, whose seeds would be one mean"
            )
    whole = pd.concat(every.values())
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
