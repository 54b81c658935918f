"""Whether skills are learned, by the rule that an experiment declared: how good they are on average, and at worst."""

from dataclasses import dataclass

import pandas as pd

from tstar_rl.analysis.tables import skills_of_arms
from tstar_rl.runs.run_folder import SKILLS

__all__ = ["Learned", "evaluated_skills", "learned_skills"]

ROUNDING = 1e-9
"""A mean of shares that is .95 in decimal numbers may be a last bit below it."""


@dataclass(frozen=True)
class Learned:
    """When a skill counts as learned.

    Attributes:
        mean: of the success over seeds, at least.
        lowest: success of the worst seed, at least.
        seeds: that were declared; with fewer there is no answer yet.
        skills: recipe that trains them.
    """

    mean: float
    lowest: float
    seeds: int
    skills: str = SKILLS


def evaluated_skills(rule: Learned, evaluations: pd.DataFrame, task: str) -> pd.DataFrame:
    """Rows of the last checkpoints of a task's skills from their own starts, deterministic, by subtask and seed.

    Args:
        rule: that was declared.
        evaluations: of `read_evaluations`.
        task: furniture.
    """
    rows = skills_of_arms(evaluations, task)
    return rows[rows["recipe"] == rule.skills].reset_index(drop=True)


def learned_skills(rule: Learned, rows: pd.DataFrame) -> pd.DataFrame:
    """Answers, subtask by subtask.

    Args:
        rule: that was declared.
        rows: of `evaluated_skills`.

    Returns:
        Index subtask; columns mean and lowest (success over seeds) and answer: yes, no, or how many seeds are there.
    """
    found = rows.groupby("subtask")["success"].agg(["mean", "min", "size"])
    found = found.rename(columns={"min": "lowest"})
    good = (found["mean"] >= rule.mean - ROUNDING) & (found["lowest"] >= rule.lowest - ROUNDING)
    said = good.map({True: "yes", False: "no"})
    few = found["size"] < rule.seeds
    said[few] = [f"measured so far: {seeds} of {rule.seeds} seeds" for seeds in found["size"][few]]
    return found.assign(answer=said).drop(columns="size")
