"""Differences of two arms of one task on the seeds that both have, and corrections for asking several questions.

An interval is the paired bootstrap's of `tstar_rl.analysis.statistics`; with fewer than some ten seeds it is too
narrow, and Student's t stands beside it.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import t as student

from tstar_rl.analysis.statistics import DIGITS, RESAMPLES, Array, interval_ends, resampled_means, seed_means

__all__ = [
    "Difference",
    "difference_of",
    "holm",
    "outer_ends",
    "paired_difference",
    "signed_interval",
    "student_half",
    "student_p",
]

AGREED = 6
"""Seeds that agree in sign, from which on the two-sided sign test has p < .05."""


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
    half, p = student_half(values), student_p(values)
    if number > 1 and _agree(values):
        if not np.round(mean, DIGITS):
            half, p = 0.0, 1.0
        elif number < AGREED:
            half, p = math.nan, math.nan
        else:
            half, p = 0.0, 2 * 0.5**number
    return Difference(mean, *interval_ends(draws), half, p, number)


def outer_ends(value: float, low: float, high: float, t_half: float) -> tuple[float, float]:
    """Ends of the wider interval at each side, the bootstrap's or Student's: both have to exclude what is excluded.

    Args:
        value: the mean.
        low, high: the bootstrap's.
        t_half: half of Student's interval; nan of one seed, or where a few seeds have one difference. The bootstrap's
            is then that of episodes alone, and where these do not vary either there is none: both ends are nan.
    """
    if math.isnan(t_half):
        return (low, high) if low < high else (math.nan, math.nan)
    return min(low, value - t_half), max(high, value + t_half)


def signed_interval(value: float, low: float, high: float) -> str:
    """A difference with its 95% interval, to three digits: an end near zero, or near a margin, decides.

    The value alone where there is no interval.
    """
    if math.isnan(low):
        return f"{value:+.3f}"
    return f"{value:+.3f} [{low:+.3f}, {high:+.3f}]"


def _agree(values: Array) -> bool:
    return bool(np.ptp(values.round(DIGITS)) == 0)


def student_half(values: Array) -> float:
    """Half of Student's 95% interval of a mean over seeds. Source: Student 1908.

    It is nan of one seed, and of fewer than `AGREED` that all have one value: that a few do not vary is no measurement
    of how far others would lie.
    """
    number = len(values)
    if number < 2 or (number < AGREED and _agree(values)):
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
