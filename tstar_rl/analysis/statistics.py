"""Statistics of arms of one task that were trained with several seeds and evaluated for many episodes each.

Scores of an arm are a list with one array of episodes for each seed. Every interval is a 95% percentile bootstrap:
seeds are drawn with replacement, then episodes within each drawn seed, so both sources of chance are in it. With
fewer than some ten seeds such an interval is too narrow; `paired_difference` gives Student's t beside it.

Source: Agarwal et al., Deep Reinforcement Learning at the Edge of the Statistical Precipice, NeurIPS 2021.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import t as student

__all__ = [
    "Difference",
    "Interval",
    "difference_of",
    "drawn_means",
    "drawn_seeds",
    "holm",
    "interquartile_mean",
    "interval_ends",
    "paired_difference",
    "performance_profile",
    "probability_of_improvement",
    "resampled_means",
    "seed_means",
    "student_half",
    "student_p",
]

Array = NDArray[np.floating]
Scores = Sequence[ArrayLike]  # (episodes,) of each seed
RESAMPLES = 5_000
AGREED = 6
"""Seeds that agree in sign, from which on the two-sided sign test has p < .05."""
DIGITS = 12
"""Of means. Sums of thirds or sevenths hang on their order in the last digits, and a tie is to be one."""


class Interval(NamedTuple):
    """An estimate and its 95% interval."""

    value: float
    low: float
    high: float


class Difference(NamedTuple):
    """Mean difference of two arms on the seeds that both have."""

    value: float
    low: float
    high: float
    t_half: float
    """Half of Student's 95% interval over seeds; see `difference_of` where all have one difference; nan of one seed."""
    p_value: float
    """Student's, two-sided, that the mean is 0; likewise."""
    seeds: int

    def verdict(self) -> str:
        """Returns "higher" or "lower" where both intervals exclude 0, else "no clear difference".

        "one seed" of one, "no spread" where a few seeds have one difference, from which nothing follows for others.
        """
        if math.isnan(self.t_half):
            return "one seed" if self.seeds == 1 else "no spread"
        sure = (self.low > 0 or self.high < 0) and abs(self.value) > self.t_half
        return "no clear difference" if not sure else "higher" if self.value > 0 else "lower"


def interquartile_mean(values: ArrayLike) -> Array:
    """Mean over the last axis of what is left when floor(n / 4) values are cut at either end.

    With fewer than four values nothing is cut: it is the mean.

    Source: Agarwal et al. 2021, section 4.3.
    """
    ordered = np.sort(np.asarray(values, dtype=float), axis=-1)
    if not ordered.shape[-1]:
        raise ValueError("the interquartile mean needs at least one value, got none")
    cut = ordered.shape[-1] // 4
    return ordered[..., cut : ordered.shape[-1] - cut].mean(-1)


def resampled_means(scores: Scores, chosen: NDArray[np.int64], rng: np.random.Generator) -> Array:
    """The mean score of each drawn seed, over episodes drawn with replacement within it.

    Args:
        scores: of one arm.
        chosen: (resamples, seeds) indices into `scores`.
        rng: draws the episodes.

    Returns:
        (resamples, seeds).
    """
    means = np.empty(chosen.shape)
    for index, episodes in enumerate(scores):
        values, counts = np.unique(np.asarray(episodes, dtype=float), return_counts=True)
        here, number = chosen == index, counts.sum()
        means[here] = rng.multinomial(number, counts / number, size=int(here.sum())) @ values / number
    return means.round(DIGITS)


def drawn_means(scores: Scores, rng: np.random.Generator, resamples: int) -> Array:
    """(resamples, seeds) means of an arm whose seeds and episodes are drawn."""
    return resampled_means(scores, rng.integers(len(scores), size=(resamples, len(scores))), rng)


def drawn_seeds(scores: Scores, rng: np.random.Generator, resamples: int) -> Array:
    """(resamples, seeds) means of an arm whose seeds are drawn, each with the mean that it has."""
    means = seed_means(scores)
    return means[rng.integers(len(means), size=(resamples, len(means)))]


def seed_means(scores: Scores) -> Array:
    """(seeds,) mean score of each seed."""
    if not len(scores) or any(not np.size(episodes) for episodes in scores):
        raise ValueError("statistics need at least one seed, and at least one episode of each")
    return np.array([np.mean(np.asarray(episodes, dtype=float)) for episodes in scores]).round(DIGITS)


def interval_ends(draws: Array) -> tuple[float, float]:
    """Ends of the 95% percentile interval."""
    low, high = np.quantile(draws, (0.025, 0.975))
    return float(low), float(high)


def paired_difference(
    first: Mapping[int, ArrayLike],
    second: Mapping[int, ArrayLike],
    rng: np.random.Generator,
    resamples: int = RESAMPLES,
) -> Difference:
    """Mean of first minus second over the seeds that both have, seeds drawn as pairs.

    Args:
        first: (episodes,) scores by seed.
        second: the same of the other arm.
        rng: draws pairs, and episodes of each arm.
        resamples: of the bootstrap.

    Raises:
        ValueError: if no seed is in both.

    Source: Efron and Tibshirani, An Introduction to the Bootstrap, 1993, chapter 8 (pairs are the unit); Student 1908.
    """
    both = sorted(set(first) & set(second))
    if not both:
        raise ValueError(f"no seed in common: {sorted(first)} and {sorted(second)}")
    pair = [[arm[seed] for seed in both] for arm in (first, second)]
    differences, number = seed_means(pair[0]) - seed_means(pair[1]), len(both)
    chosen = rng.integers(number, size=(resamples, number))
    draws = (resampled_means(pair[0], chosen, rng) - resampled_means(pair[1], chosen, rng)).mean(-1)
    return difference_of(differences, draws)


def difference_of(values: Array, draws: Array) -> Difference:
    """Mean (seeds,) of `values` with the bootstrap's interval of its `draws`, and Student's.

    Progress lies on a grid, so a few seeds may have one difference. That they do not vary is then no measurement of how
    far others would lie, and Student's test says nothing; with `AGREED` or more the sign test does. Where all are 0
    both arms did the same, which Student's test says.
    """
    mean, number = float(values.mean()), len(values)
    if np.ptp(values.round(DIGITS)) == 0 and np.round(mean, DIGITS):
        agreed = (0.0, 2 * 0.5**number) if number >= AGREED else (math.nan, math.nan)
        return Difference(mean, *interval_ends(draws), *agreed, number)
    return Difference(mean, *interval_ends(draws), student_half(values), student_p(values), number)


def student_half(values: Array) -> float:
    """Half of Student's 95% interval of a mean over seeds; nan of one seed. Source: Student 1908."""
    number = len(values)
    if number < 2:
        return math.nan
    return float(student.ppf(0.975, number - 1)) * (float(values.std(ddof=1)) / math.sqrt(number))


def student_p(values: Array) -> float:
    """Two-sided p-value of Student's test that a mean over seeds is 0; nan of one seed. Source: Student 1908."""
    number = len(values)
    if number < 2:
        return math.nan
    mean, error = round(abs(float(values.mean())), DIGITS), float(values.std(ddof=1)) / math.sqrt(number)
    far = mean / error if error else math.inf if mean else 0.0
    return float(2 * student.sf(far, number - 1))


def holm(p_values: ArrayLike) -> Array:
    """Corrected p-values of a family: where nothing differs, one of them is below a with probability a at most.

    Args:
        p_values: (n,) in [0, 1].

    Returns:
        (n,): of the k-th smallest, from 0, the largest of (n - j) p_j over j up to k, and 1 at most.

    Source: Holm, A simple sequentially rejective multiple test procedure, 1979.
    """
    values = np.asarray(p_values, dtype=float)
    order = values.argsort(kind="stable")
    steps = np.maximum.accumulate((len(values) - np.arange(len(values))) * values[order])
    corrected = np.empty_like(values)
    corrected[order] = steps.clip(max=1.0)
    return corrected


def probability_of_improvement(first: ArrayLike, second: ArrayLike) -> Array:
    """P(X > Y) + P(X = Y) / 2 for X of `first` (..., n) and Y of `second` (..., m).

    Source: Mann and Whitney 1947: U / (n m); Agarwal et al. 2021, section 4.3.
    """
    x, y = (np.asarray(values, dtype=float) for values in (first, second))
    pairs = x[..., :, None] - y[..., None, :]
    return ((pairs > 0) + 0.5 * (pairs == 0)).mean((-2, -1))


def performance_profile(values: ArrayLike, thresholds: ArrayLike) -> Array:
    """Share of the last axis of `values` (..., n) that is above each threshold: (..., thresholds).

    Source: Agarwal et al. 2021, section 4.2 (score distribution).
    """
    found = np.asarray(values, dtype=float)[..., None] > np.asarray(thresholds, dtype=float)
    return found.mean(-2)
