"""docs/every_run.md as text: a row for each run and checkpoint that was published."""

from pathlib import Path

import pandas as pd

from tstar_rl.analysis.page.contents import read_contents
from tstar_rl.analysis.page.markdown import NOTHING, Paper, labels, table
from tstar_rl.analysis.page.sections import in_order, pick
from tstar_rl.analysis.tables import evaluations_of, short_commit, whole_task

__all__ = ["runs_page"]

HEAD = """\
# Every run

<!-- Written by recipes/report.py from results/published/ and docs/paper_results.yaml. -->

A row for each run and checkpoint behind [the results](results.md), good or bad, and one for the skills of a seed, each
tried alone. The columns are explained [there](results.md#how-to-read-the-tables).
"""


def runs_page(root: str | Path, paper: Paper) -> str:
    """The whole page; ablations, whose runs the page of results lists itself, are not on it.

    Args:
        root: of the published results, with contents.yaml.
        paper: docs/paper_results.yaml, for what the arms are called.
    """
    found = [HEAD]
    for entry in read_contents(root).experiments:
        if entry.kind == "ablations":
            continue
        evaluations = evaluations_of(entry.folder)
        found.append(f"## {entry.title}")
        for task in in_order(paper, evaluations["task"]):
            found += [f"### {entry.title}: {task}", _by_seed(evaluations, entry.named(paper), task)]
            found += [_skills_by_seed(evaluations, task)]
    return "\n\n".join(part.strip() for part in found if part) + "\n"


def _by_seed(evaluations: pd.DataFrame, paper: Paper, task: str) -> str:
    """A row for each run and checkpoint."""
    whole, rows = whole_task(evaluations, task), []
    shares = [name for name in whole.columns if str(name).startswith("subtask_")]
    for system, label in labels(paper, whole["recipe"]).items():
        kept = set(whole[whole["recipe"] == system]["checkpoint"])
        for checkpoint in sorted(kept, key=lambda name: (name != "last", name != "best", name)):
            sampled = pick(whole, system, checkpoint, "stochastic").set_index("seed")["progress"]
            for _, run in pick(whole, system, checkpoint).iterrows():
                success = f"{run['success']:.1%} [{run['success_low']:.1%}, {run['success_high']:.1%}]"
                done = " ".join(f"{run[name]:.2f}" for name in shares if not pd.isna(run[name]))
                other = f"{sampled[run['seed']]:.3f}" if run["seed"] in sampled else NOTHING
                row = [label, str(run["seed"]), checkpoint, f"{run['progress']:.3f}", success, done, other]
                rows.append([*row, str(run["episodes"]), short_commit(run["commit"])])
    header = ["system", "seed", "checkpoint", "progress", "success [95%]", "by subtask", "sampled: progress"]
    return table([*header, "episodes", "commit"], rows) if rows else ""


def _skills_by_seed(evaluations: pd.DataFrame, task: str) -> str:
    """A row for each system and seed that skills were trained with: success of each alone, from its own starts."""
    alone = evaluations[(evaluations["task"] == task) & (evaluations["subtask"] >= 0)]
    rows = []
    for (system, seed), part in alone.groupby(["recipe", "seed"]):
        tried = [
            pick(part, str(system), *kind).set_index("subtask")["success"]
            for kind in (("last",), ("last", "stochastic"), ("best",))
        ]
        shares = [[f"{index}: {success:.3f}" for index, success in one.sort_index().items()] for one in tried]
        commits = " ".join(dict.fromkeys(map(short_commit, part["commit"])))
        rows.append([str(system), str(seed), *(" ".join(each) or NOTHING for each in shares), commits])
    header = ["skills", "seed", "subtask: success", "last, sampled", "best", "commit"]
    return table(header, rows) if rows else ""
