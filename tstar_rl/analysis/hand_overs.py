"""Hand-overs of chains, seam by seam: how often a skill does what it is handed, and what the signal there told."""

import math

import pandas as pd

from tstar_rl.analysis.differences import student_half
from tstar_rl.analysis.turns import AUC, SPREAD, kept_turns, tried_turns

__all__ = ["compare_hand_overs", "signal_by_seam", "success_at_hand_over"]


def success_at_hand_over(rows: pd.DataFrame) -> pd.DataFrame:
    """(seeds, subtasks): the share of episodes that do a subtask, of those that have done all before it.

    Args:
        rows: of one arm, with columns seed and subtask_0, ...: shares of all episodes.

    Returns:
        Index seed; nan where no episode came so far.
    """
    names = sorted((str(name) for name in rows if str(name).startswith("subtask_")), key=lambda n: int(n[8:]))
    done = rows.set_index("seed")[names].astype(float).dropna(axis=1, how="all")
    begun = done.shift(axis=1, fill_value=1.0)
    found = done / begun.where(begun > 0)
    return found.set_axis(range(found.shape[1]), axis=1)


def compare_hand_overs(rows: pd.DataFrame, first: str, second: str) -> pd.DataFrame:
    """How often the skill that takes over succeeds, by seam, in chains of two arms.

    Args:
        rows: of one task; see `experiments.arm_table`.
        first, second: arms.

    Returns:
        Index subtask, from 1: that of the skill that takes over. Columns seeds (how many both arms have), of (which),
        first, second (means), difference and t_half (half of Student's interval over seeds).
    """
    one, other = (success_at_hand_over(rows[rows["arm"] == arm]) for arm in (first, second))
    lines = {}
    for subtask in one.columns[1:].intersection(other.columns):
        both = pd.concat([one[subtask], other[subtask]], axis=1, keys=["first", "second"]).dropna()
        difference = (both["first"] - both["second"]).to_numpy()
        line = {"seeds": len(both), "of": tuple(both.index), **both.mean().to_dict()}
        lines[subtask] = line | {
            "difference": float(difference.mean()) if len(both) else math.nan,
            "t_half": student_half(difference),
        }
    return pd.DataFrame.from_dict(lines, orient="index").rename_axis("subtask")


def signal_by_seam(metrics: pd.DataFrame, task: str, arm: str) -> pd.DataFrame:
    """What the signal that pays a skill told of the next one's outcomes: means over kept turns, then over seeds.

    Args:
        metrics: of `tables.read_metrics`.
        task: of the chains.
        arm: whose.

    Returns:
        Index subtask: that of the skill that takes over. Columns seeds (how many have an AUC), of (which), auc,
        auc_half (Student's) and spread (over all kept turns, those without an AUC too); no rows where none was logged,
        or several signals were judged.
    """
    rows = tried_turns(metrics, task)
    rows = kept_turns(rows[rows["recipe"] == arm]) if len(rows) else rows
    told = [name for name in rows if str(name).endswith(AUC) and rows[name].notna().any()]
    lines = {}
    if len(told) == 1:
        spread = f"{str(told[0]).removesuffix(AUC)}{SPREAD}"
        for skill, mine in rows[rows[spread].notna()].groupby("skill"):
            of_seeds = mine.groupby("seed")[[told[0], spread]].mean()
            areas = of_seeds[told[0]].dropna()
            line = {"seeds": len(areas), "of": tuple(areas.index), "auc": float(areas.mean())}
            line |= {"auc_half": student_half(areas.to_numpy()), "spread": float(of_seeds[spread].mean())}
            lines[int(float(str(skill))) + 1] = line
    return pd.DataFrame.from_dict(lines, orient="index").rename_axis("subtask")
