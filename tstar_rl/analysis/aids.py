"""What each aid of a skill's training is worth: arms that leave one out, beside one that has them all."""

import math
from collections.abc import Collection
from dataclasses import dataclass

import pandas as pd

from tstar_rl.analysis.differences import student_half

__all__ = ["Aids", "worth_of_aids"]


@dataclass(frozen=True)
class Aids:
    """When an aid counts as needed: every seed succeeds with all aids, and none without this one.

    Attributes:
        all_aids: the arm that leaves nothing out.
        succeeds: with all aids every seed has more success than this.
        fails: without the aid every seed has less than this.
        seeds: that were declared; with fewer there is no answer yet.
    """

    all_aids: str
    succeeds: float
    fails: float
    seeds: int


def worth_of_aids(rule: Aids, rows: pd.DataFrame) -> pd.DataFrame:
    """Answers for each arm that leaves an aid out, subtask by subtask.

    Args:
        rule: that was declared.
        rows: of `tables.skills_of_arms`.

    Returns:
        Index subtask and arm; columns seeds (that both arms have), difference (in success, the arm less all aids, mean
        over these) with half of Student's 95% interval, and answer: needed; worth something, where that interval lies
        below 0; not decided; or how many seeds are there.
    """
    lines = {}
    for subtask, of_subtask in rows.groupby("subtask"):
        success = of_subtask.pivot(index="seed", columns="recipe", values="success")
        if rule.all_aids not in success:
            continue
        for arm in success.columns.drop(rule.all_aids):
            both = success[[arm, rule.all_aids]].dropna()
            without, complete = both[arm], success[rule.all_aids].dropna()
            differences = (without - both[rule.all_aids]).to_numpy()
            half = student_half(differences)
            line = {
                "seeds": len(both),
                "difference": differences.mean() if len(both) else math.nan,
                "half": half,
            }
            lines[subtask, str(arm)] = {**line, "answer": _answer(rule, without, complete, line)}
    index = pd.MultiIndex.from_tuples(lines, names=["subtask", "arm"])
    return pd.DataFrame(list(lines.values()), index=index)


def _answer(
    rule: Aids, without: Collection[float], complete: Collection[float], line: dict[str, float]
) -> str:
    if line["seeds"] < rule.seeds:
        return f"measured so far: {line['seeds']} of {rule.seeds} seeds"
    if max(without) < rule.fails and min(complete) > rule.succeeds:
        return "needed"
    return "worth something" if line["difference"] + line["half"] < 0.0 else "not decided"
