"""docs/results.md as text, and the block of it that the README shows.

The same tables give the same text. Nothing is left out for being bad; what the paper does not have stands beside it.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from tstar_rl.analysis import report_tables as tables
from tstar_rl.analysis.plotting import read_evaluations, read_metrics

__all__ = ["curve_groups", "other_roots", "replace_block", "results_head", "results_page"]

BEGIN, END = "<!-- results: begin -->", "<!-- results: end -->"
WRITTEN = (
    "<!-- Written by recipes/report.py from results/, docs/paper_results.yaml and docs/results_notes.md. -->"
)
READING = """\
Mean +- standard deviation over seeds. A seed is 200 fresh deterministic episodes, on seeds that nothing was trained or
chosen on. A subtask done is a quarter of the progress; success is the whole task. The paper gives its best checkpoint,
over 5 seeds. Ours are the last one, and the best: of a chain, that which did best on trials of its own after each
turn; of a single policy, that with the highest running mean of subtasks completed in training.
"""
CAPTIONS = {
    "skills": "Success of the skills in training, a line a seed.",
    "chains": "Fine-tuning the chains: success in training, a colour a skill; trials of the whole, a colour a seed.",
    "single_policies": "Policies of the whole task in training: mean phase, and subtasks completed an episode.",
}


def curve_groups(metrics: pd.DataFrame, task: str) -> dict[str, pd.DataFrame]:
    """What a task's runs logged: the skills', the chains' and the other whole-task policies', those that there are."""
    rows = metrics[(metrics.task == task) & (metrics.env_steps > 0)] if len(metrics) else metrics
    if rows.empty:
        return {}
    chained = rows["skill"].notna() if "skill" in rows else pd.Series(False, rows.index)
    whole = (rows["subtask"] == -1) & ~chained
    groups = {"skills": rows[rows["subtask"] >= 0], "chains": rows[chained]}
    groups["single_policies"] = rows[whole]
    return {name: group for name, group in groups.items() if len(group)}


def curves(metrics: pd.DataFrame, task: str, prefix: str = "") -> str:
    """Links to the figures of `curve_groups`."""
    names = curve_groups(metrics, task)
    return "\n".join(
        f"![{CAPTIONS[name]}](figures/{prefix}{task}_{name}.png)\n\n{CAPTIONS[name]}\n" for name in names
    )


def _evaluations(root: str | Path) -> pd.DataFrame:
    """Every evaluation; a script, which does not learn, is its own last checkpoint."""
    found = read_evaluations(root)
    return found.assign(checkpoint=found["checkpoint"].replace("script", "last"))


def _sections(title: str, parts: dict[str, str]) -> str:
    """A heading with a part for each task that has one; nothing if none has."""
    found = [f"### {task}\n\n{part}" for task, part in parts.items() if part]
    return "\n".join([f"## {title}\n", *found]) if found else ""


def other_roots(root: str | Path) -> list[Path]:
    """Folders below the results that hold results of their own, <folder>/<task>/<recipe>/seed<k>: other conditions."""
    return sorted({file.parents[3] for file in Path(root).glob("*/*/*/seed*/evaluation.csv")})


def _intro(folder: Path) -> str:
    """What the folder's README.md says, a title first."""
    said = folder / "README.md"
    return (said.read_text() if said.is_file() else f"# {folder.name}\n").strip()


def _section_of(folder: Path, paper: dict[str, Any]) -> str:
    """What was run under other conditions; the folder's README.md says which."""
    evaluations, metrics = _evaluations(folder), read_metrics(folder)
    parts = []
    for task in tables.tasks({"tasks": []}, evaluations):
        prefix = f"{folder.name}_"
        each = [
            tables.means(evaluations, paper, task),
            tables.by_seed(evaluations, paper, folder, task),
            tables.skills(evaluations, task),
            tables.hand_over(folder, task, paper, prefix),
            tables.figure_4(folder, task, paper, prefix),
            curves(metrics, task, prefix),
        ]
        parts.append("\n".join([f"### {task}\n", *(part for part in each if part)]))
    return "\n".join([f"#{_intro(folder)}\n", *parts])


def results_page(root: str | Path, paper: str | Path, notes: str | Path) -> str:
    """The whole page.

    Args:
        root: folder of results.
        paper: file of the paper's figures, see docs/paper_results.yaml.
        notes: file of what was seen, in a person's words; it goes in as it is.
    """
    root, theirs = Path(root), yaml.safe_load(Path(paper).read_text())
    evaluations, metrics = _evaluations(root), read_metrics(root)
    names = tables.tasks(theirs, evaluations)
    each = {
        "The paper's table and ours": lambda task: tables.comparison(evaluations, theirs, task),
        "Budgets": lambda task: tables.budgets(evaluations, theirs, task),
        "Skills": lambda task: tables.skills(evaluations, task),
        "What the skills hand over": lambda task: tables.hand_over(root, task, theirs),
        "Where the third skill ends: the paper's Figure 4": lambda task: tables.figure_4(root, task, theirs),
        "Curves": lambda task: curves(metrics, task),
        "Every run": lambda task: tables.by_seed(evaluations, theirs, root, task),
    }
    said = {title: _sections(title, {task: part(task) for task in names}) for title, part in each.items()}
    first, *rest = said.values()
    ablated = tables.ablations(root)
    parts = ["# Results", WRITTEN, READING, first, Path(notes).read_text(), *rest]
    parts += [f"## Ablations\n\n{ablated}"] if ablated else []
    parts += [_section_of(folder, theirs) for folder in other_roots(root)]
    return "\n\n".join(part.strip() for part in parts if part) + "\n"


def results_head(root: str | Path, paper: str | Path, folders: Iterable[str] = ()) -> str:
    """What the README shows: the comparison for each task that has been run, and what was run under other conditions.

    Args:
        root: folder of results.
        paper: file of the paper's figures.
        folders: which of `other_roots`, by name; one that is not there is left out.
    """
    root, theirs, evaluations = Path(root), yaml.safe_load(Path(paper).read_text()), _evaluations(root)
    parts = [
        f"`{task}`\n\n{tables.comparison(evaluations, theirs, task)}"
        for task in tables.tasks(theirs, evaluations)
        if len(tables.whole_task(evaluations, task))
    ]
    for folder in (folder for folder in other_roots(root) if folder.name in set(folders)):
        title = _intro(folder).splitlines()[0].removeprefix("# ")
        link = f"[{title}](docs/results.md#{title.lower().replace(' ', '-')})"
        others = _evaluations(folder)
        for task in tables.tasks({"tasks": []}, others):
            parts.append(f"{link}, `{task}`\n\n{tables.means(others, theirs, task)}")
    return "\n".join([READING, *parts])


def replace_block(text: str, block: str) -> str:
    """The text with what is between the two markers replaced.

    Raises:
        ValueError: if the markers are not there.
    """
    if text.count(BEGIN) != 1 or text.count(END) != 1:
        raise ValueError(f"the text needs one line {BEGIN} and, after it, one line {END}")
    before, rest = text.split(BEGIN)
    return f"{before}{BEGIN}\n{block.strip()}\n{END}{rest.split(END)[1]}"
