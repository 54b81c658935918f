"""An experiment as a part of the page: its arms with intervals, its comparisons and its questions."""

import math
from collections.abc import Collection, Hashable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tstar_rl.analysis.differences import holm, outer_ends, signed_interval, student_half
from tstar_rl.analysis.experiments import Experiment, arm_table, check_arms, compare_arms
from tstar_rl.analysis.figures import arms_figure, differences_figure, save_figure
from tstar_rl.analysis.gaps_of_runs import hand_over_gaps
from tstar_rl.analysis.page.contents import Entry
from tstar_rl.analysis.page.markdown import (
    NOTHING,
    Paper,
    arm_label,
    arm_order,
    interval,
    interval_of,
    millions,
    picture,
    table,
)
from tstar_rl.analysis.questions import answer
from tstar_rl.runs.run_folder import is_untrained

__all__ = ["answers", "arms", "comparison_table", "comparisons", "draw_experiment", "short_table"]

ARMS = (
    "{title}, `{task}`, last checkpoints. Left: progress; middle: success of the whole task; a dot is a seed, a black "
    "bar the interquartile mean with its 95% interval. Right: the share of seeds above a progress."
)
PAIRS = (
    "{title}, `{task}`: differences in progress on the same seed, a dot for each. Below them the mean with its "
    "bootstrap interval, black, and Student's, grey."
)
HOMINGS = "homings"
"""The column of evaluation.csv that chains with recovery have."""
FEW = 4
"""Seeds, below which the interval of a probability of improvement is too narrow, or nearly all of 0 to 1: not shown."""
STARRED = (
    "\n\\* In this gap the skills' success is that before fine-tuning, or before normalisers were changed.\n"
)


def ordered(experiment: Experiment, paper: Paper, task: str, mode: str = "deterministic") -> pd.DataFrame:
    """Rows of the last checkpoint, arms in the order of `markdown.arm_order`."""
    rows = experiment.chosen(task, "last", mode)
    order = {name: place for place, name in enumerate(arm_order(paper, rows["arm"]))}
    return rows.sort_values(
        ["arm", "seed"], key=lambda v: v.map(order) if v.name == "arm" else v, ignore_index=True
    )


def _gap(gaps: pd.DataFrame, arm: str, rows: pd.DataFrame, entry: Entry) -> list[str]:
    """Product of the skills' own success and gap, means over seeds; a star where the skills are not the arm's own.

    The gap has half of Student's 95% interval. Where some seeds have none, it says how many have.
    """
    mine = gaps[gaps["arm"] == arm]
    if mine["gap"].isna().all() or arm in entry.no_gap:
        return [NOTHING, NOTHING]
    as_they_are = is_untrained(arm) or (HOMINGS in rows and rows[HOMINGS].notna().all())
    star = "" if as_they_are or mine["fine_tuned"].all() else " \\*"
    known = mine["gap"].notna().sum()
    of = f" ({known} of {len(mine)} seeds)" if known < len(mine) else ""
    half = student_half(mine["gap"].dropna().to_numpy())
    ends = "" if math.isnan(half) else f" +- {half:.3f}"
    return [f"{mine['product'].mean():.3f}{of}", f"{mine['gap'].mean():z.3f}{ends}{of}{star}"]


def arms(experiment: Experiment, paper: Paper, entry: Entry, task: str) -> str:
    """The table of the arms of a task, and their figure."""
    rows, sampled = (ordered(experiment, paper, task, mode) for mode in ("deterministic", "stochastic"))
    gaps, noisy = hand_over_gaps(experiment, task), arm_table(sampled)
    best = arm_table(experiment.chosen(task, "best"))
    lines, starred = [], False
    for arm, row in arm_table(rows).iterrows():
        mine = rows[rows["arm"] == arm]
        line = [arm_label(paper, str(arm)), f"{row['seeds']:.0f}"]
        line += [interval_of(row, name) for name in ("progress", "success")]
        line.append(" ".join(f"{value:.2f}" for value in mine["progress"]))
        line += [_of(noisy, arm, int(row["seeds"])), _of(best, arm, int(row["seeds"]))]
        gap = _gap(gaps, str(arm), mine, entry)
        starred = starred or gap[1].endswith("\\*")
        lines.append([*line, *gap, millions(mine["env_steps"].mean()), *_way(mine, rows)])
    header = [
        "arm",
        "seeds",
        "progress [95%]",
        "success [95%]",
        "progress of each seed",
        "sampled actions: progress",
        "best checkpoint: progress",
        "product of its skills (mean)",
        "hand-over gap (mean, Student's 95%)",
        "environment steps, without trials",
        *(["steps of an episode (mean)", "ways home in it (mean)"] if HOMINGS in rows else []),
    ]
    found = table(header, lines)
    said = ARMS.format(title=entry.title, task=task)
    return f"{picture(said, f'{entry.prefix}{task}_arms')}\n{found}{STARRED if starred else ''}"


def _of(levels: pd.DataFrame, arm: Hashable, seeds: int) -> str:
    """The progress of an arm that `levels` may lack, or have of fewer than all `seeds`."""
    if arm not in levels.index:
        return NOTHING
    known = int(levels.loc[arm, "seeds"])
    return f"{levels.loc[arm, 'progress']:.3f}" + (f" ({known} of {seeds} seeds)" if known < seeds else "")


def _way(mine: pd.DataFrame, rows: pd.DataFrame) -> list[str]:
    """Of an arm, how long an episode is and how often the arm goes home in it, where any arm of `rows` does."""
    if HOMINGS not in rows:
        return []
    homings = mine[HOMINGS].mean()
    return [f"{mine['episode_length'].mean():.0f}", NOTHING if math.isnan(homings) else f"{homings:.2f}"]


def short_table(
    experiment: Experiment, paper: Paper, entry: Entry, task: str, shown: Collection[str] = ()
) -> str:
    """Arms of a task in four columns, for the notes and the README.

    Args:
        experiment: of runs.
        paper: with the arms' labels.
        entry: of contents.yaml.
        task: one of the experiment's.
        shown: which arms; none named: all.

    Raises:
        InvalidValueError: for an arm that the task does not have.
    """
    rows, gaps, lines = ordered(experiment, paper, task), hand_over_gaps(experiment, task), []
    check_arms(task, shown, rows["arm"].unique())
    rows = rows[rows["arm"].isin(shown)] if shown else rows
    for arm, row in arm_table(rows).iterrows():
        mine = rows[rows["arm"] == arm]
        spans = [interval_of(row, name) for name in ("progress", "success")]
        lines.append(
            [arm_label(paper, str(arm)), *spans, _gap(gaps, str(arm), mine, entry)[1], f"{row['seeds']:.0f}"]
        )
    starred = STARRED if any("\\*" in line[-2] for line in lines) else ""
    return (
        table(
            ["chain", "progress [95%]", "success [95%]", "hand-over gap (mean, Student's 95%)", "seeds"],
            lines,
        )
        + starred
    )


def comparison_table(experiment: Experiment, paper: Paper, entry: Entry, task: str) -> str:
    """The compared pairs of a task; nothing if none shares a seed."""
    lines = []
    found = compare_arms(ordered(experiment, paper, task), entry.pairs, absent_ok=True)
    corrected = _corrected(found, entry)
    for row in found.itertuples():
        better = (row.improvement, row.improvement_low, row.improvement_high)
        half = NOTHING if math.isnan(row.t_half) else f"+- {row.t_half:.3f}"
        line = [f"{arm_label(paper, row.first)} minus {arm_label(paper, row.second)}", str(row.seeds)]
        line += [signed_interval(row.difference, row.low, row.high), half]
        line.append(interval(*better) if int(row.seeds) >= FEW else f"{row.improvement:.3f}")
        line.insert(2, str(row.won))
        ours = [_p_value(corrected.get((row.first, row.second)))] if corrected else []
        lines.append([*line, *ours, str(row.verdict)])
    header = ["difference in progress", "seeds", "won", "mean [95%, bootstrap]", "95%, Student's t"]
    header += ["probability of improvement [95%]", *(["p, Holm"] if corrected else []), "verdict"]
    return table(header, lines) if lines else ""


def answers(experiment: Experiment, paper: Paper, entry: Entry, task: str) -> str:
    """The declared questions with their answers, and what was measured; nothing if none was declared."""
    asked = [one for one in entry.questions if task in (one.tasks or (task,))]
    if not asked:
        return ""
    found = compare_arms(ordered(experiment, paper, task), entry.pairs, absent_ok=True)
    corrected = _corrected(found, entry)
    if len(found):
        found["corrected"] = [
            corrected.get(pair, math.nan) for pair in zip(found["first"], found["second"], strict=True)
        ]
    lines = []
    for question in asked:
        measured = {(row.first, row.second): row for row in found.itertuples()}
        shown = [_measured(measured.get(pair), question.improvement is not None) for pair in question.pairs]
        lines.append([question.asks, "; ".join(shown), f"**{answer(question, found)}**"])
    return table(["question, declared before", "difference in progress [95%]", "answer"], lines)


def _measured(row: Any, with_improvement: bool) -> str:
    """A pair's difference and, where that decides, its improvement; nothing of one that was not run."""
    if row is None:
        return NOTHING
    shown = signed_interval(row.difference, *outer_ends(row.difference, row.low, row.high, row.t_half))
    improvement = f", improvement {row.improvement:.2f}, {_p_words(row.corrected)}"
    return shown + (improvement if with_improvement else "")


def _corrected(found: pd.DataFrame, entry: Entry) -> dict[tuple[str, str], float]:
    """p-values of each family, corrected for all of it: a pair not run, or on one seed, counts with a p of 1."""
    if found.empty:
        return {}
    known = {(row.first, row.second): row.p_value for row in found.itertuples()}
    corrected = {}
    for family in entry.families:
        values = np.nan_to_num([known.get(pair, math.nan) for pair in family], nan=1.0)
        corrected |= dict(zip(family, holm(values), strict=True))
    return corrected


def _p_value(value: float | None) -> str:
    return NOTHING if value is None or math.isnan(value) else "< .001" if value < 0.001 else f"{value:.3f}"


def _p_words(value: float) -> str:
    said = _p_value(value)
    return f"p {said}" if said.startswith("<") else f"p = {said}"


def comparisons(experiment: Experiment, paper: Paper, entry: Entry, task: str) -> str:
    """The table of the compared pairs of a task, and their figure; nothing if none shares a seed."""
    found = comparison_table(experiment, paper, entry, task)
    said = PAIRS.format(title=entry.title, task=task)
    return f"{picture(said, f'{entry.prefix}{task}_differences')}\n{found}" if found else ""


def draw_experiment(experiment: Experiment, paper: Paper, entry: Entry, figures: Path) -> list[Path]:
    """Writes the figures that `arms` and `comparisons` show."""
    found = []
    for task in filter(entry.has_section, experiment.tasks):
        rows = ordered(experiment, paper, task)
        called = {arm: arm_label(paper, arm) for arm in rows["arm"]}
        found.append(
            save_figure(
                arms_figure(rows, called, entry.figure_arms), figures / f"{entry.prefix}{task}_arms.png"
            )
        )
        if len(compare_arms(rows, entry.pairs, absent_ok=True)):
            drawn = differences_figure(rows, entry.pairs, called, absent_ok=True)
            found.append(save_figure(drawn, figures / f"{entry.prefix}{task}_differences.png"))
    return found
