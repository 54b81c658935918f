"""Parts of the page that are tables of what was run: beside the paper, budgets, hand-overs."""

from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from tstar_rl.analysis import ablations, variants
from tstar_rl.analysis.page.markdown import (
    NOTHING,
    Paper,
    interval_of,
    labels,
    millions,
    over_seeds,
    picture,
    share,
    table,
    theirs,
)
from tstar_rl.analysis.tables import whole_task
from tstar_rl.runs.csv_tables import read_table

__all__ = [
    "ablated",
    "budgets",
    "comparison",
    "figure_4",
    "hand_over",
    "in_order",
    "pick",
]

TIME = """\
Ours: wall-clock minutes of processes with one thread each, two at a time on two cores that may have been busy with
other things as well. A chain's row includes the training of its skills; demonstrations and evaluation are in no row.
Steps are those learned from. A chain's trials, for its gate and to know its best, are in the minutes alone; the table
of turns, where there is one, counts their steps.
"""
HANDED = """\
Success of each skill from where the one before ends / from its own starts: fresh deterministic episodes, mean over
seeds. Each skill has the steps of one subtask; in the whole task a slow one also uses what those before it left.
"""
SPREAD = """\
Terminal states of successes in training, in three equal parts of the rollouts that had one. Poses are metres and
quaternions of all parts.
"""


def in_order(paper: Paper, tasks: Iterable[str]) -> list[str]:
    """Each task once, the paper's first."""
    ours = set(tasks)
    return [*(task for task in paper["tasks"] if task in ours), *sorted(ours - set(paper["tasks"]))]


def pick(
    evaluations: pd.DataFrame, system: str, checkpoint: str, mode: str = "deterministic"
) -> pd.DataFrame:
    """The rows of a system, one for each seed."""
    chosen = evaluations[evaluations["recipe"] == system]
    return chosen[(chosen["checkpoint"] == checkpoint) & (chosen["mode"] == mode)].sort_values("seed")


def comparison(evaluations: pd.DataFrame, paper: Paper, task: str) -> str:
    """The paper's Table 1 and ours for one task."""
    whole, rows = whole_task(evaluations, task), []
    for system, label in labels(paper, whole["recipe"]).items():
        last, best = (pick(whole, system, checkpoint) for checkpoint in ("last", "best"))
        paper_said = theirs(paper, system, task)
        if paper_said == [NOTHING, NOTHING] and last.empty and best.empty:
            continue
        row = [label, *paper_said]
        for ours in (last, best):
            row += [over_seeds(ours["progress"]), over_seeds(ours["success"], percent=True)]
        seeds = max(last["seed"].nunique(), best["seed"].nunique())
        rows.append([*row, str(seeds) if seeds else "not run"])
    header = ["system", "paper: progress", "success", "ours, last: progress", "success"]
    return table([*header, "ours, best: progress", "success", "seeds"], rows)


def budgets(evaluations: pd.DataFrame, paper: Paper, task: str) -> str:
    """Steps and time, the paper's and ours."""
    whole, rows = whole_task(evaluations, task), []
    for system, label in labels(paper, whole["recipe"]).items():
        known, last = paper["systems"].get(system, {}), pick(whole, system, "last")
        if last.empty:
            continue
        hours = known.get("hours", paper["hours"])
        workers = known.get("workers", paper["workers"])
        long = (
            f"{hours} h{f', {workers} workers' if workers else ''}" if "steps" in known and hours else NOTHING
        )
        steps = millions(last["env_steps"].mean()) if last["env_steps"].mean() else "none"
        rows.append([label, known.get("steps", NOTHING), long, steps, f"{last['minutes'].mean():.1f}"])
    header = ["system", "paper: steps", "paper: time", "ours: environment steps", "ours: minutes of one core"]
    return f"{TIME}\n{table(header, rows)}" if rows else ""


def figure_4(root: Path, task: str, paper: Paper, prefix: str) -> str:
    """Spread of the third skill's terminal states, from what `recipes/terminal_states.py` wrote."""
    path = root / task / "terminal_states_spread.csv"
    if not path.is_file():
        return ""
    found, rows = read_table(path), []
    names = labels(paper, found["system"])
    for (system, seed), part in found.groupby(["system", "seed"], sort=False):
        numbers = [
            [f"{run.spread:.4f}", f"{run.spread_position:.5f}", str(run.states)] for run in part.itertuples()
        ]
        cells = [" / ".join(three) for three in zip(*numbers, strict=True)]
        rows.append([names[str(system)], str(seed), *cells])
    header = ["system", "seed", "trace of the covariance, by third", "of positions alone, m2", "states"]
    said = (
        "Where the third skill ends over training: poses of all parts at its successes, on the two directions in which "
        "they vary most; a panel for each system, a dot for each success, its colour the progress of training."
    )
    shown = picture(said, f"{prefix}{task}_terminal_states")
    return f"{shown}\n{SPREAD}\n{table(header, rows)}"


def hand_over(root: Path, task: str, paper: Paper, prefix: str) -> str:
    """Each skill from where the one before ends and from its own starts, from what `recipes/hand_over.py` wrote."""
    path = root / task / "hand_over.csv"
    if not path.is_file():
        return ""
    found, rows = read_table(path), []
    for system, label in labels(paper, found["system"]).items():
        for checkpoint, part in found[found["system"] == system].groupby("checkpoint", sort=False):
            groups = [group for _, group in part.groupby("subtask")]
            cells = [f"{share(g['handed_over'])} / {share(g['own_starts'])}" for g in groups]
            cells[0] = share(groups[0]["own_starts"])
            rows.append([f"{label}, {checkpoint}", *cells, str(part["seed"].nunique())])
    width = max(len(row) for row in rows) - 2
    rows = [row[:-1] + [NOTHING] * (width + 2 - len(row)) + row[-1:] for row in rows]
    header = ["system", *(f"skill {index + 1}" for index in range(width)), "seeds"]
    said = "Success of each skill, mean over seeds: left from its own starts, right from where the one before it ends."
    shown = picture(said, f"{prefix}{task}_hand_over")
    return f"{shown}\n{HANDED}\n{table(header, rows)}"


def ablated(root: Path) -> str:
    """A table and its finding for each ablation that has been run."""
    sections = []
    for name in variants.names():
        if not any(root.glob(f"*/{variants.FOLDER}/{name}/*/seed*/evaluation.csv")):
            continue
        found, rows = ablations.load_ablation(name, root), []
        for (task, variant), line in ablations.ablation_table(found).iterrows():  # pyright: ignore[reportGeneralTypeIssues]
            spans = [interval_of(line, measure) for measure in ("progress", "success")]
            rows.append([f"{task}: {variant}", *spans, f"{line['seeds']:.0f}"])
        shown = table([name, "progress [95%]", "success [95%]", "seeds"], rows)
        sections.append(f"### {name}\n\n{shown}\n```\n{ablations.ablation_finding(found)}\n```\n")
    return "\n".join(sections)
