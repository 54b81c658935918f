"""Statistics of an arm over several tasks: seeds are drawn within their task, and every task has the same weight.

`strata` has the scores of each task, in one order for all arms; scores are those of `statistics`: an array of episodes
for each seed. Tasks are not drawn. So an interval says what other seeds would give on these tasks; it says nothing of
other tasks.

Where all tasks have the same number of seeds, these are the definitions of the source. Where one has more, pooled runs
would give it more weight; here each of its seeds counts for less instead.

Source: Agarwal et al., Deep Reinforcement Learning at the Edge of the Statistical Precipice, NeurIPS 2021.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq
from scipy.stats import norm

from tstar_rl.analysis.statistics import (
    RESAMPLES,
    Array,
    Interval,
    Scores,
    drawn_means,
    interquartile_mean,
    interval_ends,
    performance_profile,
    probability_of_improvement,
    seed_means,
)

__all__ = [
    "equal_weights",
    "improvement_over_tasks",
    "interquartile_interval",
    "least_when_all_win",
    "profile_over_tasks",
    "weighted_interquartile_mean",
]

Strata = Sequence[Scores]
Draw = Callable[[Scores, np.random.Generator, int], Array]


def equal_weights(seeds: Sequence[int]) -> NDArray[np.int64]:
    """How often each seed has to be counted so that every task is counted as often: the smallest such numbers.

    Args:
        seeds: number of seeds of each task.

    Returns:
        (sum of `seeds`,): of each seed, task by task. Two and three seeds: 3, 3, 2, 2, 2.

    Raises:
        ValueError: if there is no task, or one without a seed.
    """
    if not seeds or min(seeds) < 1:
        raise ValueError(
            f"statistics over tasks need at least one task, and a seed of each; got {list(seeds)}"
        )
    return np.repeat(math.lcm(*seeds) // np.asarray(seeds, dtype=np.int64), seeds)


def weighted_interquartile_mean(values: ArrayLike, weights: ArrayLike) -> Array:
    """The interquartile mean of a list in which the i-th value stands `weights[i]` times.

    Args:
        values: (..., n).
        weights: (n,) positive integers. All 1: `statistics.interquartile_mean`.
    """
    values = np.asarray(values, dtype=float)
    order = np.argsort(values, axis=-1)
    up_to = np.cumsum(np.asarray(weights, dtype=np.int64)[order], axis=-1)
    cut = up_to[..., -1:] // 4
    kept = np.diff(np.clip(up_to, cut, up_to[..., -1:] - cut), prepend=cut)
    return (np.take_along_axis(values, order, -1) * kept).sum(-1) / kept.sum(-1)


def interquartile_interval(strata: Strata, rng: np.random.Generator, resamples: int = RESAMPLES) -> Interval:
    """Interquartile mean over the mean scores of all seeds, with its stratified bootstrap interval.

    A quarter of the runs is cut at either end, whatever their task. So the hardest of seven tasks may not be in it.

    Args:
        strata: scores of each task. One task: `[scores]`.
        rng: draws seeds and episodes.
        resamples: of the bootstrap.

    Source: Agarwal et al. 2021, section 4.1 (stratified bootstrap) and 4.3 (interquartile mean).
    """
    weights = equal_weights([len(scores) for scores in strata])
    means = np.concatenate([seed_means(scores) for scores in strata])
    draws = np.concatenate([drawn_means(scores, rng, resamples) for scores in strata], axis=1)
    if (weights == 1).all():
        value, drawn = interquartile_mean(means), interquartile_mean(draws)
    else:
        value, drawn = (weighted_interquartile_mean(each, weights) for each in (means, draws))
    return Interval(float(value), *interval_ends(drawn))


def improvement_over_tasks(
    first: Strata,
    second: Strata,
    rng: np.random.Generator,
    resamples: int = RESAMPLES,
    draw: Draw = drawn_means,
) -> Interval:
    """Probability that a seed of `first` beats a seed of `second` on the same task, mean over tasks, with its interval.

    The interval is a bootstrap's. A task on which the probability is 0 or 1 a bootstrap takes for certain: there the
    interval reaches at least as far as `least_when_all_win` of such tasks and the bootstrap of the others say together.

    Args:
        first: scores of each task. One task: `[scores]`.
        second: the same of the other arm; tasks in the same order.
        rng: draws seeds and episodes.
        resamples: of the bootstrap.
        draw: `drawn_means`, or `drawn_seeds` for seeds alone, as in the source. The first draws episodes once more than
            their seeds' means have them already, which pulls the interval towards .5 where episodes vary as much as
            seeds. Source: docs/decisions/0017-intervals.md.

    Raises:
        ValueError: if the arms have different numbers of tasks.

    Source: Agarwal et al. 2021, section 4.3; see `statistics.probability_of_improvement`.
    """
    if len(first) != len(second) or not first:
        raise ValueError(
            f"both arms need the same tasks, and at least one; got {len(first)} and {len(second)}"
        )
    values, draws, others = [], np.zeros(resamples), np.zeros(resamples)
    # On tasks that are all won, or all lost: how far the probability may be from 1, or from 0.
    below: list[float] = []
    above: list[float] = []
    for one, other in zip(first, second, strict=True):
        value = probability_of_improvement(seed_means(one), seed_means(other))
        drawn = probability_of_improvement(*(draw(scores, rng, resamples) for scores in (one, other)))
        values.append(value)
        draws += drawn
        if value in (0.0, 1.0):
            (below if value else above).append(1.0 - least_when_all_win(len(one), len(other)))
        else:
            others += drawn - value
    mean, (low, high) = float(np.mean(values)), interval_ends(draws / len(first))
    down, up = interval_ends(others / len(first))
    if below:  # tasks are independent
        low = min(low, mean - math.hypot(min(down, 0.0), np.linalg.norm(below) / len(first)))
    if above:
        high = max(high, mean + math.hypot(max(up, 0.0), np.linalg.norm(above) / len(first)))
    return Interval(mean, max(low, 0.0), min(high, 1.0))


def least_when_all_win(first: int, second: int) -> float:
    """Lower end of the 95% interval of a probability of improvement where every seed of an arm beats all of another.

    A bootstrap draws nothing but wins there, and would be certain. This is the p below 1 that solves
    1 - p = z^2 p [1 + N (1 - p) / (2 - p) + N p / (1 + p)] / (m n), with N = (m + n) / 2 - 1 and z = 1.96.

    Args:
        first, second: numbers of seeds, m and n.

    Source: Newcombe, Confidence intervals for an effect size measure based on the Mann-Whitney statistic. Part 2,
    Statistics in Medicine 2006: method 5.
    """
    more, z = (first + second) / 2 - 1, float(norm.ppf(0.975))

    def beyond(p: float) -> float:
        spread = 1 + more * ((1 - p) / (2 - p) + p / (1 + p))
        return 1 - p - z**2 * p * spread / (first * second)

    return float(brentq(beyond, 0.0, 1.0))


def profile_over_tasks(
    strata: Strata, thresholds: ArrayLike, rng: np.random.Generator, resamples: int = RESAMPLES
) -> tuple[Array, Array, Array]:
    """Share of runs above each threshold, mean over tasks, and the lower and the upper end of its band.

    Each is (thresholds,).

    Source: Agarwal et al. 2021, section 4.2 (score distribution); pointwise 95%.
    """
    if not strata:
        raise ValueError("a performance profile needs at least one task")
    shares = np.mean([performance_profile(seed_means(scores), thresholds) for scores in strata], axis=0)
    drawn = np.zeros((resamples, np.size(thresholds)))
    for scores in strata:
        drawn += performance_profile(drawn_means(scores, rng, resamples), thresholds)
    low, high = np.quantile(drawn / len(strata), (0.025, 0.975), axis=0)
    return shares, low, high
