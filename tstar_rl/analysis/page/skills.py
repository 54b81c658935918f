"""Parts of the page that are of single skills: what each aid is worth, which are learned, each alone."""

import math

import pandas as pd

from tstar_rl.analysis.aids import Aids, worth_of_aids
from tstar_rl.analysis.differences import signed_interval
from tstar_rl.analysis.learned import Learned, evaluated_skills, learned_skills
from tstar_rl.analysis.page.markdown import (
    NOTHING,
    Paper,
    arm_label,
    interval,
    millions,
    over_seeds,
    table,
)
from tstar_rl.analysis.page.sections import pick
from tstar_rl.analysis.tables import skills_of_arms

__all__ = ["aids", "learned", "skills"]


def aids(rule: Aids | None, evaluations: pd.DataFrame, paper: Paper, task: str) -> str:
    """What a task's skills lose without each aid; nothing where no rule was declared, or nothing was run.

    Args:
        rule: that was declared.
        evaluations: of `read_evaluations`.
        paper: with the arms' labels.
        task: furniture.
    """
    rows = pd.DataFrame() if rule is None else skills_of_arms(evaluations, task)
    if rule is None or rows.empty:
        return ""
    sampled, worth, lines = skills_of_arms(evaluations, task, "stochastic"), worth_of_aids(rule, rows), []
    for subtask, of_subtask in rows.groupby("subtask"):
        for arm in sorted(of_subtask["recipe"].unique(), key=lambda name: name != rule.all_aids):
            mine, noisy = (
                each[(each["subtask"] == subtask) & (each["recipe"] == arm)] for each in (rows, sampled)
            )
            line = [str(subtask), arm_label(paper, arm), _of_each_seed(mine), over_seeds(noisy["success"])]
            lines.append([*line, *_worth(worth.loc[subtask, arm] if (subtask, arm) in worth.index else None)])
    header = ["subtask", "training", "success of each seed [95%, Wilson]", "sampled actions"]
    asked = f"needed: below {rule.fails:g} on every seed, above {rule.succeeds:g} with all aids"
    return table([*header, "less that with all aids [95%, Student's t]", asked], lines)


def _worth(found: pd.Series | None) -> list[str]:
    if found is None:
        return [NOTHING, NOTHING]
    value, half = float(found["difference"]), float(found["half"])
    ends = signed_interval(value, value - half, value + half)
    return [NOTHING if math.isnan(value) else ends, f"**{found['answer']}**"]


def skills(evaluations: pd.DataFrame, task: str) -> str:
    """Success of each subtask's skill alone, from its own starts."""
    alone, rows = evaluations[(evaluations["task"] == task) & (evaluations["subtask"] >= 0)], []
    for (system, subtask), part in alone.groupby(["recipe", "subtask"]):
        last, best = (pick(part, str(system), checkpoint) for checkpoint in ("last", "best"))
        sampled = pick(part, str(system), "last", "stochastic")
        row = [over_seeds(one["success"], percent=True) for one in (last, sampled, best)]
        trained = best if last.empty else last  # what else is there was kept on the way, as SPiRL's prior
        steps = millions(trained["env_steps"].mean())
        rows.append([f"{system}, subtask {subtask}", *row, steps, str(part["seed"].nunique())])
    return (
        table(["skill", "last", "last, sampled", "best", "environment steps", "seeds"], rows) if rows else ""
    )


def learned(rule: Learned | None, evaluations: pd.DataFrame, task: str) -> str:
    """Which skills of a task are learned, by the declared rule; nothing where none was declared, or none was run."""
    rows = pd.DataFrame() if rule is None else evaluated_skills(rule, evaluations, task)
    if rule is None or rows.empty:
        return ""
    lines = []
    for subtask, found in learned_skills(rule, rows).iterrows():
        seeds = _of_each_seed(rows[rows["subtask"] == subtask])
        lines.append([str(subtask), seeds, f"{found['mean']:.3f}", f"**{found['answer']}**"])
    asked = f"learned: {rule.mean:g} or more on average, {rule.lowest:g} or more on every seed"
    return table(["subtask", "success of each seed [95%, Wilson]", "mean", asked], lines)


def _of_each_seed(rows: pd.DataFrame) -> str:
    """Success with Wilson's interval."""
    return "; ".join(
        f"{row.seed}: {interval(row.success, row.success_low, row.success_high)}" for row in rows.itertuples()
    )
