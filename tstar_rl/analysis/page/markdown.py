"""Tables and numbers as Markdown, and what systems and arms are called."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pandas as pd

from tstar_rl.analysis.differences import student_half
from tstar_rl.analysis.figures.panels import readable

__all__ = [
    "NOTHING",
    "anchor",
    "arm_label",
    "arm_order",
    "from_to",
    "interval",
    "interval_of",
    "labels",
    "mean_and_half",
    "millions",
    "over_seeds",
    "picture",
    "share",
    "signal_label",
    "table",
    "theirs",
]

Paper = Mapping[str, Any]
"""docs/paper_results.yaml."""
NOTHING = "-"
NARROW = 0.02


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; columns after the first are set to the right."""
    lines = ["| " + " | ".join(header) + " |", "|---|" + "---:|" * (len(header) - 1)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)]) + "\n"


def picture(words: str, file: str) -> str:
    """A figure in docs/figures with its caption."""
    return f"![{words}](figures/{file}.png)\n"


def anchor(title: str) -> str:
    """The link to a heading, as GitHub makes it."""
    kept = "".join(letter for letter in title.lower() if letter.isalnum() or letter in " -_")
    return kept.replace(" ", "-")


def over_seeds(values: pd.Series, percent: bool = False) -> str:
    """Mean +- standard deviation over seeds; the value alone of one seed."""
    if values.empty:
        return NOTHING
    scale, digits, unit = (100, 1, "%") if percent else (1, 3, "")
    text = f"{scale * values.mean():.{digits}f}"
    if len(values) > 1:
        text += f" +- {scale * values.std(ddof=1):.{digits}f}"
    return text + unit


def share(values: pd.Series) -> str:
    """A mean share; nothing where no seed has one."""
    return NOTHING if values.isna().all() else f"{values.mean():.2f}"


def interval(value: float, low: float, high: float) -> str:
    """A share with its 95% interval; a narrow one with one more digit."""
    digits = _digits(low, high)
    return f"{value:.3f} [{low:.{digits}f}, {high:.{digits}f}]"


def interval_of(row: pd.Series, name: str) -> str:
    """The same of the columns <name>, <name>_low and <name>_high; `NOTHING` where there is no value."""
    value, low, high = (float(row[f"{name}{end}"]) for end in ("", "_low", "_high"))
    return NOTHING if math.isnan(value) else interval(value, low, high)


def theirs(paper: Paper, system: str, task: str) -> list[str]:
    """The paper's progress and success of a system on a task."""
    found = paper["systems"].get(system, {})
    progress, success = found.get("progress", {}).get(task), found.get("success", {}).get(task)
    shown = f"{progress[0]:.2f} +- {progress[1]:.2f}" if progress else NOTHING
    return [shown, NOTHING if success is None else f"{success:.0%}"]


def millions(steps: float) -> str:
    """A number of steps; nothing where it is not known."""
    return NOTHING if math.isnan(steps) else f"{steps / 1e6:.2f}M"


def from_to(low: int, high: int) -> str:
    """The fewest and the most, or the one number that they are."""
    return str(low) if low == high else f"{low} to {high}"


def mean_and_half(values: pd.Series, digits: int) -> str:
    """Mean over seeds with half of Student's 95% interval; the value alone of one seed, nothing of none."""
    if values.empty:
        return NOTHING
    half = student_half(values.to_numpy())
    return f"{values.mean():.{digits}f}" + ("" if math.isnan(half) else f" +- {half:.{digits}f}")


def _digits(low: float, high: float) -> int:
    """Two, or three where two would hide most of the interval."""
    return 3 if high - low < NARROW else 2


def _known(paper: Paper) -> dict[str, str]:
    """Labels of the paper's systems, then of our arms."""
    systems = {name: values["label"] for name, values in paper["systems"].items()}
    return systems | {name: label for name, label in paper.get("arms", {}).items() if name not in systems}


def arm_order(paper: Paper, found: Iterable[str]) -> list[str]:
    """Arms in the order of the paper file's `arms`, each followed by its variants; then what else has been run."""
    known = list(paper.get("arms", {}))

    def place(arm: str) -> tuple[int, int, str]:
        return (known.index(_base(paper, arm)) if _base(paper, arm) in known else len(known), len(arm), arm)

    return sorted(set(found), key=place)


def _base(paper: Paper, arm: str) -> str:
    """An arm's name without its endings."""
    for ending in paper.get("arm_endings", {}):
        if arm.endswith(ending):
            return _base(paper, arm.removesuffix(ending))
    return arm


def labels(paper: Paper, found: Iterable[str]) -> dict[str, str]:
    """What rows are called, in their order: the paper's systems, our arms, then what else has been run."""
    known = _known(paper)
    return known | {name: arm_label(paper, name) for name in sorted(set(found) - set(known))}


def arm_label(paper: Paper, arm: str) -> str:
    """What an arm is called: its own name, then what its endings say (`_no_gate`, ...)."""
    known = _known(paper)
    if arm not in known:
        for ending, words in paper.get("arm_endings", {}).items():
            if arm.endswith(ending):
                return f"{arm_label(paper, arm.removesuffix(ending))}, {words}"
    return known.get(arm, arm)


def signal_label(paper: Paper, arm: str, signal: str, signals: int) -> str:
    """What an arm's signal is called: the arm, and where it has several, which."""
    return arm_label(paper, arm) + (f": {readable(signal)}" if signals > 1 else "")
