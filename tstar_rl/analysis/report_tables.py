"""The tables of docs/results.md as Markdown: the paper's beside ours, from the tables that runs leave behind."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from tstar_rl.analysis import ablation
from tstar_rl.analysis.ablation_plots import ablation_finding, ablation_table, load_ablation

__all__ = [
    "ablations",
    "budgets",
    "by_seed",
    "comparison",
    "figure_4",
    "hand_over",
    "means",
    "skills",
    "tasks",
    "whole_task",
]

Paper = Mapping[str, Any]
NOTHING = "-"
TIME = """\
Ours: wall-clock minutes of processes with one thread each, two at a time on two cores that may have been busy with
other things as well; the skills' training is counted with the chains, demonstrations and evaluation with nothing.
Steps are those learned from: trials of a chain, for its gate and to know its best, are in the minutes alone.
"""
HANDED = """\
Success of each skill from where the one before ends / from its own starts: fresh deterministic episodes, mean over
seeds. Each skill has the steps of one subtask; in the whole task a slow one also uses what those before it left.
"""
SPREAD = """\
Terminal states of successes in training, in three equal parts of it. Poses are metres and quaternions of all parts.
"""


def markdown(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; columns after the first are set to the right."""
    lines = ["| " + " | ".join(header) + " |", "|---|" + "---:|" * (len(header) - 1)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)]) + "\n"


def over_seeds(values: pd.Series, percent: bool = False) -> str:
    """Mean +- standard deviation over seeds; the value alone of one seed."""
    if values.empty:
        return NOTHING
    scale, digits, unit = (100, 1, "%") if percent else (1, 3, "")
    text = f"{scale * values.mean():.{digits}f}"
    if len(values) > 1:
        text += f" +- {scale * values.std(ddof=1):.{digits}f}"
    return text + unit


def labels(paper: Paper, found: Iterable[str]) -> dict[str, str]:
    """Names of systems as rows call them: the paper's order, then what else has been run."""
    known = {name: values["label"] for name, values in paper["systems"].items()}
    return known | {name: name for name in sorted(set(found) - set(known))}


def tasks(paper: Paper, evaluations: pd.DataFrame) -> list[str]:
    """The paper's tasks, then what else has been run."""
    return [*paper["tasks"], *sorted(set(evaluations["task"]) - set(paper["tasks"]))]


def whole_task(evaluations: pd.DataFrame, task: str) -> pd.DataFrame:
    """The rows of policies and chains that did the whole task."""
    return evaluations[(evaluations.task == task) & (evaluations.subtask == -1)]


def pick(rows: pd.DataFrame, system: str, checkpoint: str, mode: str = "deterministic") -> pd.DataFrame:
    """The rows of a system, one a seed."""
    chosen = rows[(rows.recipe == system) & (rows.checkpoint == checkpoint) & (rows["mode"] == mode)]
    return chosen.sort_values("seed")


def comparison(evaluations: pd.DataFrame, paper: Paper, task: str) -> str:
    """The paper's Table 1 and ours for one task."""
    whole, rows = whole_task(evaluations, task), []
    for system, label in labels(paper, whole["recipe"]).items():
        theirs = paper["systems"].get(system, {})
        progress, success = theirs.get("progress", {}).get(task), theirs.get("success", {}).get(task)
        last, best = (pick(whole, system, checkpoint) for checkpoint in ("last", "best"))
        if progress is None and last.empty and best.empty:
            continue
        row = [f"{progress[0]:.2f} +- {progress[1]:.2f}" if progress else NOTHING]
        row.append(f"{success:.0%}" if success is not None else NOTHING)
        for ours in (last, best):
            row += [over_seeds(ours.progress), over_seeds(ours.success, percent=True)]
        seeds = max(last.seed.nunique(), best.seed.nunique())
        rows.append([label, *row, str(seeds) if seeds else "not run"])
    header = ["system", "paper: progress", "success", "ours, last: progress", "success"]
    return markdown([*header, "ours, best: progress", "success", "seeds"], rows)


def means(evaluations: pd.DataFrame, paper: Paper, task: str) -> str:
    """Ours alone, over seeds."""
    whole, rows = whole_task(evaluations, task), []
    for system, label in labels(paper, whole["recipe"]).items():
        runs = [pick(whole, system, checkpoint) for checkpoint in ("last", "best")]
        if any(len(run) for run in runs):
            cells = [(over_seeds(run.progress), over_seeds(run.success, percent=True)) for run in runs]
            steps = f"{runs[0].env_steps.mean() / 1e6:.2f}M"
            rows.append([label, *cells[0], *cells[1], steps, str(runs[0].seed.nunique())])
    header = [
        "system",
        "last: progress",
        "success",
        "best: progress",
        "success",
        "environment steps",
        "seeds",
    ]
    return markdown(header, rows)


def budgets(evaluations: pd.DataFrame, paper: Paper, task: str) -> str:
    """Steps and time, the paper's and ours."""
    whole, rows = whole_task(evaluations, task), []
    for system, label in labels(paper, whole["recipe"]).items():
        theirs, last = paper["systems"].get(system, {}), pick(whole, system, "last")
        if last.empty:
            continue
        hours = theirs.get("hours", paper["hours"])
        long = f"{hours} h, {paper['workers']} workers" if "steps" in theirs and hours else NOTHING
        steps = f"{last.env_steps.mean() / 1e6:.2f}M" if last.env_steps.mean() else "none"
        rows.append([label, theirs.get("steps", NOTHING), long, steps, f"{last.minutes.mean():.1f}"])
    header = ["system", "paper: steps", "paper: time", "ours: environment steps", "ours: minutes of one core"]
    return f"{TIME}\n{markdown(header, rows)}" if rows else ""


def by_seed(evaluations: pd.DataFrame, paper: Paper, root: Path, task: str) -> str:
    """A row for each run and checkpoint."""
    whole, rows = whole_task(evaluations, task), []
    shares = [name for name in whole.columns if str(name).startswith("subtask_")]
    for system, label in labels(paper, whole["recipe"]).items():
        kept = set(whole[whole.recipe == system].checkpoint)
        for checkpoint in sorted(kept, key=lambda name: (name != "last", name != "best", name)):
            sampled = pick(whole, system, checkpoint, "stochastic").set_index("seed").progress
            for _, run in pick(whole, system, checkpoint).iterrows():
                config = root / task / system / f"seed{run.seed}" / "config.yaml"
                interval = f"{run.success:.1%} [{run.success_low:.1%}, {run.success_high:.1%}]"
                done = " ".join(f"{run[name]:.2f}" for name in shares if not pd.isna(run[name]))
                other = f"{sampled[run.seed]:.3f}" if run.seed in sampled else NOTHING
                row = [str(run.seed), checkpoint, f"{run.progress:.3f}", interval, done, other]
                rows.append([label, *row, str(run.episodes), _commit(config)])
    header = ["system", "seed", "checkpoint", "progress", "success [95%]", "by subtask", "sampled: progress"]
    return markdown([*header, "episodes", "commit"], rows) if rows else ""


def _commit(config: Path) -> str:
    if not config.is_file():
        return NOTHING
    return str(yaml.safe_load(config.read_text())["versions"]["commit"])[:7]


def skills(evaluations: pd.DataFrame, task: str) -> str:
    """Success of each subtask's skill alone, from its own starts."""
    alone, rows = evaluations[(evaluations.task == task) & (evaluations.subtask >= 0)], []
    for (system, subtask), part in alone.groupby(["recipe", "subtask"]):
        last, best = (pick(part, str(system), checkpoint) for checkpoint in ("last", "best"))
        row = [over_seeds(one.success, percent=True) for one in (last, best)]
        trained = best if last.empty else last  # what else is there was kept on the way, as SPiRL's prior
        steps = f"{trained.env_steps.mean() / 1e6:.2f}M" if len(trained) else NOTHING
        rows.append([f"{system}, subtask {subtask}", *row, steps, str(part.seed.nunique())])
    return markdown(["skill", "last", "best", "environment steps", "seeds"], rows) if rows else ""


def figure_4(root: Path, task: str, paper: Paper, prefix: str = "") -> str:
    """Spread of the third skill's terminal states, from what `recipes/terminal_states.py` wrote."""
    path = root / task / "terminal_states_spread.csv"
    if not path.is_file():
        return ""
    table = pd.read_csv(path)
    names, rows = labels(paper, table["system"]), []
    for (system, seed), part in table.groupby(["system", "seed"], sort=False):
        numbers = [
            [f"{run.spread:.4f}", f"{run.spread_position:.5f}", str(run.states)] for run in part.itertuples()
        ]
        rows.append(
            [names[str(system)], str(seed), *(" / ".join(three) for three in zip(*numbers, strict=True))]
        )
    header = ["system", "seed", "trace of the covariance, by third", "of positions alone, m2", "states"]
    picture = f"![Where the third skill ends over training.](figures/{prefix}{task}_terminal_states.png)\n\n{SPREAD}\n"
    return picture + markdown(header, rows)


def hand_over(root: Path, task: str, paper: Paper, prefix: str = "") -> str:
    """Each skill from where the one before ends and from its own starts, from what `recipes/hand_over.py` wrote."""
    path = root / task / "hand_over.csv"
    if not path.is_file():
        return ""
    table, rows = pd.read_csv(path), []
    for system, label in labels(paper, table["system"]).items():
        for checkpoint, part in table[table.system == system].groupby("checkpoint", sort=False):
            groups = [group for _, group in part.groupby("subtask")]
            cells = [f"{_share(g.handed_over)} / {_share(g.own_starts)}" for g in groups]
            cells[0] = _share(groups[0].own_starts)
            rows.append([f"{label}, {checkpoint}", *cells, str(part.seed.nunique())])
    width = max(len(row) for row in rows) - 2
    rows = [row[:-1] + [NOTHING] * (width + 2 - len(row)) + row[-1:] for row in rows]
    picture = f"![What the skills hand over.](figures/{prefix}{task}_hand_over.png)\n\n{HANDED}\n"
    header = ["system", *(f"skill {index}" for index in range(width)), "seeds"]
    return picture + markdown(header, rows)


def _share(values: pd.Series) -> str:
    """A mean share; nothing where no seed has one."""
    return NOTHING if values.isna().all() else f"{values.mean():.2f}"


def ablations(root: Path) -> str:
    """A table and its finding for each ablation that has been run."""
    sections = []
    for name in ablation.names():
        if not any(root.glob(f"*/{ablation.FOLDER}/{name}/*/seed*/evaluation.csv")):
            continue
        found, rows = load_ablation(name, root), []
        for (task, variant), line in ablation_table(found).iterrows():  # pyright: ignore[reportGeneralTypeIssues]
            spans = [
                f"{line[one]:.3f} [{line[f'{one}_low']:.3f}, {line[f'{one}_high']:.3f}]"
                for one in ("progress", "success")
            ]
            rows.append([f"{task}: {variant}", *spans, f"{line.seeds:.0f}"])
        table = markdown([name, "progress [95%]", "success [95%]", "seeds"], rows)
        sections.append(f"### {name}\n\n{table}\n```\n{ablation_finding(found)}\n```\n")
    return "\n".join(sections)
