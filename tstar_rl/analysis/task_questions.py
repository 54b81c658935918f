"""Questions that an experiment over several tasks declared before it ran, answered by the rule declared with them."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.stats import binomtest, norm

from tstar_rl.analysis.experiments import SEED, TaskScores
from tstar_rl.analysis.over_tasks import paired_scores
from tstar_rl.analysis.questions import POWER
from tstar_rl.analysis.statistics import DIGITS, drawn_means, drawn_seeds
from tstar_rl.analysis.task_statistics import improvement_over_tasks

__all__ = ["TaskQuestion", "answer_over_tasks", "compare_over_tasks", "paired_runs", "sign_test"]

NO_DIFFERENCE = 0.5
"""Of the probability of improvement."""
POWERED = float(norm.ppf((0.975, POWER)).sum() / norm.ppf(0.975))
"""How many times narrower an interval must be to end at a limit with the chance POWER, and not with one of a half."""


@dataclass(frozen=True)
class TaskQuestion:
    """Whether one arm does better than another over tasks.

    Attributes:
        asks: in words.
        pair: (first, second).
        runs: of an arm, each a seed of a task, that were declared; with fewer there is no answer yet.
        margin: the answer is no if the interval of the probability of improvement lies below it.
    """

    asks: str
    pair: tuple[str, str]
    runs: int
    margin: float = 0.75


def compare_over_tasks(
    scores: TaskScores, tasks: Sequence[str], pairs: Iterable[tuple[str, str]]
) -> pd.DataFrame:
    """Pairs of arms over several tasks, on the seeds that both have; pairs that lack one of the tasks are left out.

    Args:
        scores: of an experiment, `Experiment.scores`.
        tasks: over which they are compared.
        pairs: (first, second).

    Returns:
        Columns first, second; tasks: over which they are compared; ahead and behind: on how many of these the mean
        difference by seed is above 0, and below; improvement: probability that a seed of the first beats one of the
        second on the same task, mean over tasks; improvement_low and improvement_high, and seeds_low and seeds_high:
        its interval if seeds alone are drawn.
    """
    lines = []
    for first, second in pairs:
        pair = paired_scores(scores, tasks, first, second)
        if not tasks or pair is None:
            continue
        one, other = pair
        means = [(_mean_of_seeds(a), _mean_of_seeds(b)) for a, b in zip(one, other, strict=True)]
        line = {"first": first, "second": second, "tasks": len(tasks)}
        line |= {"ahead": sum(a > b for a, b in means), "behind": sum(a < b for a, b in means)}
        for name, draw in (("seeds", drawn_seeds), ("improvement", drawn_means)):
            better = improvement_over_tasks(one, other, np.random.default_rng(SEED), draw=draw)
            line |= {"improvement": better.value, f"{name}_low": better.low, f"{name}_high": better.high}
        lines.append(line)
    return pd.DataFrame(lines)


def sign_test(wins: int, tasks: int) -> float:
    """Two-sided p-value of `wins` of `tasks`; what was not won counts as lost, ties too."""
    return float(binomtest(wins, tasks).pvalue)


def _mean_of_seeds(seeds: Sequence[np.ndarray]) -> float:
    return round(float(np.mean([np.mean(episodes) for episodes in seeds])), DIGITS)


def paired_runs(scores: TaskScores, first: str, second: str) -> int:
    """Seeds that both arms have, of all tasks."""
    return sum(len(set(arms.get(first, {})) & set(arms.get(second, {}))) for arms in scores.values())


def answer_over_tasks(question: TaskQuestion, found: pd.DataFrame, runs: int) -> str:
    """What the comparison says.

    Yes: the interval of the probability of improvement lies above .5, and the first is ahead on so many tasks that the
    sign test has p < .05. No, or not by much: that does not hold, and the interval lies below the margin. It does
    worse: as yes, the other way round. Else it is not decided; the answer then says on how many tasks the first is
    ahead, where these are too few, and how many times as many seeds would decide in four of five cases, should the
    interval shrink with their root and stay where it is, and the tasks that the first is ahead on be the same.

    The rule reads the interval of `drawn_means`. Where that of `drawn_seeds` gives another answer, both are said.

    Args:
        question: that was declared.
        found: of `compare_over_tasks`.
        runs: of the pair that were measured, of `paired_runs`; those of a task that another one lacks count too.
    """
    rows = (
        found[(found["first"] == question.pair[0]) & (found["second"] == question.pair[1])]
        if len(found)
        else found
    )
    if runs < question.runs:
        return f"measured so far: {runs} of {question.runs} runs"
    if not len(rows):
        return f"not decided: a task has no seed of both, {' and '.join(question.pair)}"
    row = rows.iloc[0]
    said, alone = (_answer(row, question.margin, name) for name in ("improvement", "seeds"))
    kind, other = (each.split(";")[0] for each in (said, alone))
    return said if kind == other else f"{said} (of seeds alone: {alone})"


def _answer(row: pd.Series, margin: float, interval: str) -> str:
    """By the interval of that name."""
    value, low, high = (float(row[name]) for name in ("improvement", f"{interval}_low", f"{interval}_high"))
    tasks, ahead, behind = (int(row[name]) for name in ("tasks", "ahead", "behind"))
    needed = _wins_needed(tasks)
    if low > NO_DIFFERENCE and needed is not None and ahead >= needed:
        return "yes"
    if high < margin:
        worse = high < NO_DIFFERENCE and needed is not None and behind >= needed
        return "no: it does worse" if worse else "no, or not by much"
    said, rooms = "not decided", [(high - value, margin - value)]
    if needed is None or ahead < needed:
        asked = "of which no number suffices" if needed is None else f"where {needed} are asked"
        said += f"; ahead on {ahead} of {tasks} tasks, {asked}" if value > NO_DIFFERENCE else ""
    elif low <= NO_DIFFERENCE:
        rooms.append((value - low, value - NO_DIFFERENCE))
    times = [(POWERED * half / room) ** 2 for half, room in rooms if room > 0]
    enough = f"; {math.ceil(10 * min(times)) / 10:g} times as many seeds probably would" if times else ""
    return said + enough


def _wins_needed(tasks: int) -> int | None:
    """The fewest wins, more than half, with which the sign test has p < .05; None: too few tasks."""
    return next((wins for wins in range(tasks // 2 + 1, tasks + 1) if sign_test(wins, tasks) < 0.05), None)
