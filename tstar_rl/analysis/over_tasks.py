"""Arms over several tasks: which tasks and seeds each of them has, and their table.

An arm is only compared with others on tasks that both have. So there are at most two sets of tasks: all of them, for
the arms that have them all, and those that every arm has.
"""

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tstar_rl.analysis.experiments import SEED, Experiment, TaskScores
from tstar_rl.analysis.gaps_of_runs import links_of
from tstar_rl.analysis.tables import config_of
from tstar_rl.analysis.task_statistics import improvement_over_tasks, interquartile_interval
from tstar_rl.runs.run_folder import SKILLS, run_path

__all__ = [
    "arms_with",
    "lacking_seeds",
    "lacking_tasks",
    "paired_scores",
    "skills_of_tasks",
    "task_sets",
    "tasks_table",
]

PairedScores = tuple[list[list[NDArray[np.floating]]], list[list[NDArray[np.floating]]]]
"""Of either arm: by task and seed, the progress of every episode."""


def arms_with(scores: TaskScores, tasks: Sequence[str]) -> list[str]:
    """The arms that have all of these tasks."""
    every = dict.fromkeys(arm for arms in scores.values() for arm in arms)
    return [arm for arm in every if all(arm in scores[task] for task in tasks)]


def task_sets(scores: TaskScores) -> list[list[str]]:
    """The tasks over which arms are aggregated: all of them; then those that every arm has, if some arm lacks one.

    A set has at least two tasks, and an arm that has them all.
    """
    every = arms_with(scores, [])
    common = [task for task, arms in scores.items() if set(arms) == set(every)]
    sets = [list(scores)] if common == list(scores) else [list(scores), common]
    return [tasks for tasks in sets if len(tasks) > 1 and arms_with(scores, tasks)]


def lacking_tasks(scores: TaskScores) -> dict[str, list[str]]:
    """Of each arm that lacks tasks which other arms have: those tasks."""
    every = arms_with(scores, [])
    found = {arm: [task for task, arms in scores.items() if arm not in arms] for arm in every}
    return {arm: tasks for arm, tasks in found.items() if tasks}


def lacking_seeds(scores: TaskScores) -> dict[str, dict[str, list[int]]]:
    """Of each arm, on the tasks that it has: the seeds that another arm has there and it lacks."""
    found: dict[str, dict[str, list[int]]] = {}
    for task, arms in scores.items():
        every = {seed for seeds in arms.values() for seed in seeds}
        for arm, seeds in arms.items():
            if every - set(seeds):
                found.setdefault(arm, {})[task] = sorted(every - set(seeds))
    return found


def tasks_table(scores: TaskScores, tasks: Sequence[str], reference: str) -> pd.DataFrame:
    """A line for each arm that has all of these tasks.

    Args:
        scores: of an experiment, `Experiment.scores`.
        tasks: over which it is aggregated.
        reference: the arm that the others are compared with, on the seeds that both have.

    Returns:
        Index arm; columns seeds_low and seeds_high (the fewest and the most of a task), runs, progress, progress_low,
        progress_high, the same three of success, and of improvement: probability that a seed of the arm beats one of
        the reference on the same task; nan for the reference, and where the two share no seed of a task.
    """
    lines = {}
    for arm in arms_with(scores, tasks):
        strata = [list(scores[task][arm].values()) for task in tasks]
        seeds = [len(each) for each in strata]
        line: dict[str, float] = {"seeds_low": min(seeds), "seeds_high": max(seeds), "runs": sum(seeds)}
        done = [[episodes >= 1.0 for episodes in each] for each in strata]
        for name, measured in (("progress", strata), ("success", done)):
            line |= interquartile_interval(measured, np.random.default_rng(SEED)).columns(name)
        names = ("improvement", "improvement_low", "improvement_high")
        lines[arm] = line | dict(zip(names, _improvement(scores, tasks, arm, reference), strict=True))
    return pd.DataFrame.from_dict(lines, orient="index").rename_axis("arm")


def paired_scores(scores: TaskScores, tasks: Sequence[str], first: str, second: str) -> PairedScores | None:
    """Scores of two arms on the seeds that both have, for each task; None if they share no seed of one of the tasks."""
    found: PairedScores = ([], [])
    for task in tasks:
        one, other = (scores[task].get(arm, {}) for arm in (first, second))
        seeds = sorted(set(one) & set(other))
        if not seeds:
            return None
        for each, arm in zip(found, (one, other), strict=True):
            each.append([arm[seed] for seed in seeds])
    return found


def _improvement(
    scores: TaskScores, tasks: Sequence[str], arm: str, reference: str
) -> tuple[float, float, float]:
    """Of an arm over the reference, on the seeds that both have of each task; nan if a task has none."""
    both = paired_scores(scores, tasks, arm, reference)
    if arm == reference or both is None:
        return math.nan, math.nan, math.nan
    return improvement_over_tasks(*both, np.random.default_rng(SEED))


def skills_of_tasks(experiment: Experiment, arm: str) -> dict[str, list[float]]:
    """Of each task that an arm has: success of the skills that it starts from, in order, mean over the arm's seeds.

    That of their last checkpoints, deterministic, from their own starts; [] where some of them were not tried alone, on
    some seed.
    """
    found: dict[str, list[float]] = {}
    for task in experiment.tasks:
        runs, skills = experiment.chosen(task), experiment.skills
        runs = runs[runs["arm"] == arm]
        seeds = runs["seed"].tolist()
        if not seeds:
            continue
        source = config_of(run_path(experiment.root, task, arm, seeds[0])).get("skills", SKILLS)
        if len(skills):
            skills = skills[(skills["task"] == task) & (skills["arm"] == source) & skills["seed"].isin(seeds)]
            skills = skills[(skills["checkpoint"] == "last") & (skills["mode"] == "deterministic")]
        links = max(links_of(run) for _, run in runs.iterrows())
        skills = skills[skills["subtask"] < links] if len(skills) else skills
        all_tried = len(skills) and {*zip(skills["subtask"], skills["seed"], strict=True)} >= {
            (subtask, seed) for subtask in range(links) for seed in seeds
        }
        found[task] = skills.groupby("subtask")["success"].mean().tolist() if all_tried else []
    return found
