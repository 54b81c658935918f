"""Questions that an experiment declared before it ran, answered from its comparisons by the rule declared with them."""

import math
from dataclasses import dataclass

import pandas as pd
from scipy.stats import t as student

__all__ = ["Question", "answer", "seeds_to_decide"]

MOST_SEEDS = 1_000
"""Beyond these a number of seeds is not looked for."""
FEWEST_SEEDS = 10
"""With fewer the spread is too uncertain to say how many would do."""
POWER = 0.8
"""Chance with which that number of seeds would decide."""


@dataclass(frozen=True)
class Question:
    """A question about pairs of arms.

    Attributes:
        asks: in words.
        pairs: (first, second); the answer is yes if the first is higher in every pair, in every interval.
        seeds: that were declared; with fewer there is no answer yet.
        margin: the answer is no if both intervals of every pair lie below it, and a yes says so; None: no such answer.
        improvement: the answer is yes only if in every pair the probability of improvement is at least this, and the
            p-value, corrected for the family, below .05. None: the intervals decide.
        tasks: of which it is asked; none named: all.
    """

    asks: str
    pairs: tuple[tuple[str, str], ...]
    seeds: int
    margin: float | None = None
    improvement: float | None = None
    tasks: tuple[str, ...] = ()


def answer(question: Question, found: pd.DataFrame) -> str:
    """What the comparisons say.

    Args:
        question: that was declared.
        found: of `compare_arms`; where the question has an `improvement`, with a column `corrected` of p-values.
    """
    if found.empty:
        return f"measured so far: 0 of {question.seeds} seeds"
    lines = [found[(found["first"] == one) & (found["second"] == other)] for one, other in question.pairs]
    measured = min(int(line["seeds"].max()) if len(line) else 0 for line in lines)
    if measured < question.seeds:
        return f"measured so far: {measured} of {question.seeds} seeds"
    rows = pd.concat(lines)
    if question.improvement is not None:
        sure = (rows["improvement"] >= question.improvement) & (rows["corrected"] < 0.05)
        return "yes" if (sure & (rows["difference"] > 0)).all() else "not shown"
    below = question.margin is not None and _below(rows, question.margin)
    if (rows["verdict"] == "higher").all():
        return f"yes, by less than {question.margin:g}" if below else "yes"
    if (rows["verdict"] == "lower").all():
        return "no: it is lower"
    if question.margin is None:
        return "not shown"
    if below:
        return f"no: a gain of {question.margin:g} is ruled out"
    if measured < FEWEST_SEEDS or (len(rows) > 1 and not rows["verdict"].eq("no clear difference").all()):
        return (
            "not decided"  # pairs of which some are settled may be settled in ways that no answer is made for
        )
    needed = [seeds_to_decide(*one, question.margin, measured) for one in zip(*_spread(rows), strict=True)]
    return f"not decided; {max(needed)} seeds probably would" if all(needed) else "not decided"


def _below(rows: pd.DataFrame, margin: float) -> bool:
    """Whether both intervals of every difference lie below a margin."""
    return bool(((rows["high"] < margin) & (rows["difference"] + rows["t_half"] < margin)).all())


def _spread(rows: pd.DataFrame) -> tuple[list[float], list[float]]:
    """Mean of each difference, and the deviation over seeds with which Student's interval reaches as far as either.

    An answer needs both intervals: the bootstrap's may reach further than Student's, on one side or on both.
    """
    reach = pd.concat(
        [rows["t_half"], rows["high"] - rows["difference"], rows["difference"] - rows["low"]], axis=1
    )
    quantiles = student.ppf(0.975, rows["seeds"] - 1)
    return rows["difference"].tolist(), (
        reach.max(axis=1, skipna=False) * rows["seeds"] ** 0.5 / quantiles
    ).tolist()


def seeds_to_decide(mean: float, deviation: float, margin: float, measured: int = 1) -> int | None:
    """With how many seeds, more than there are, Student's interval would exclude 0 or the margin in four of five cases.

    The difference and its standard deviation over seeds are taken to stay what they are. None: more than 1,000.

    Args:
        mean: difference of two arms.
        deviation: of that difference over seeds.
        margin: from which on a difference matters.
        measured: seeds that there are, and that did not decide.

    Source: Cohen, Statistical Power Analysis for the Behavioral Sciences, 1988, chapter 2.
    """
    room = max(mean, margin - mean)

    def decides(seeds: int) -> bool:
        quantiles = student.ppf((0.975, POWER), seeds - 1).sum()
        return quantiles * deviation / math.sqrt(seeds) < room

    return next(filter(decides, range(measured + 1, MOST_SEEDS + 1)), None)
