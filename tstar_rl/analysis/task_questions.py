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
from tstar_rl.analysis.task_statistics import improvement_over_tasks

__all__ = ["TaskQuestion", "answer_over_tasks", "compare_over_tasks"]

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
        tasks: over which they are compared; of the others runs are counted alone.
        pairs: (first, second).

    Returns:
        Columns first, second; runs: seeds that both have, of all tasks in `scores`; tasks: over which they are
        compared; ahead: on how many of these the mean difference by seed is above 0; p_value: of the two-sided sign
        test over these tasks, a tie counting against the first; improvement: probability that a seed of the first beats
        one of the second on the same task, mean over tasks; improvement_low, improvement_high.
    """
    lines = []
    for first, second in pairs:
        pair = paired_scores(scores, tasks, first, second)
        if not tasks or pair is None:
            continue
        one, other = pair
        runs = sum(len(set(arms.get(first, {})) & set(arms.get(second, {}))) for arms in scores.values())
        ahead = sum(_mean_of_seeds(a) > _mean_of_seeds(b) for a, b in zip(one, other, strict=True))
        better = improvement_over_tasks(one, other, np.random.default_rng(SEED))
        line = {"first": first, "second": second, "runs": runs, "tasks": len(tasks)}
        line |= {"ahead": ahead, "p_value": float(binomtest(ahead, len(tasks)).pvalue)}
        ends = {"improvement_low": better.low, "improvement_high": better.high}
        lines.append({**line, "improvement": better.value, **ends})
    return pd.DataFrame(lines)


def _mean_of_seeds(seeds: Sequence[np.ndarray]) -> float:
    return round(float(np.mean([np.mean(episodes) for episodes in seeds])), 12)


def answer_over_tasks(question: TaskQuestion, found: pd.DataFrame) -> str:
    """What the comparison says.

    Yes: the interval of the probability of improvement lies above .5, and the first is ahead on so many tasks that the
    sign test has p < .05. No: it does not lie above .5, and lies below the margin; below .5, the first does worse. Else
    it is not decided, and the answer says how many times as many seeds would, in four of five cases, should the
    interval shrink with their root and stay where it is.

    Args:
        question: that was declared.
        found: of `compare_over_tasks`.
    """
    rows = (
        found[(found["first"] == question.pair[0]) & (found["second"] == question.pair[1])]
        if len(found)
        else found
    )
    runs = int(rows["runs"].iloc[0]) if len(rows) else 0
    if runs < question.runs:
        return f"being measured: {runs} of {question.runs} runs"
    row = rows.iloc[0]
    value, low, high = (float(row[f"improvement{end}"]) for end in ("", "_low", "_high"))
    if low > NO_DIFFERENCE:
        sure = row["ahead"] > row["tasks"] / 2 and row["p_value"] < 0.05
        return "yes" if sure else f"not decided: ahead on {row['ahead']} of {row['tasks']} tasks alone"
    if high < NO_DIFFERENCE:
        return "no: it does worse"
    if high < question.margin:
        return "no, or not by much"
    needed = [
        (POWERED * half / room) ** 2
        for half, room in ((value - low, value - NO_DIFFERENCE), (high - value, question.margin - value))
        if room > 0
    ]
    return f"not decided; {math.ceil(10 * min(needed)) / 10:g} times as many seeds probably would"
