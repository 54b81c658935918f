"""Statistics of arms of one task that were trained with several seeds and evaluated for many episodes each.

Scores of an arm are a list with one array of episodes for each seed. Every interval is a 95% percentile bootstrap:
seeds are drawn with replacement, then episodes within each drawn seed, so both sources of chance are in it. With
fewer than some ten seeds such an interval is too narrow.

Source: Agarwal et al., Deep Reinforcement Learning at the Edge of the Statistical Precipice, NeurIPS 2021.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "Interval",
    "drawn_means",
    "drawn_seeds",
    "interquartile_mean",
    "interval_ends",
    "performance_profile",
    "probability_of_improvement",
    "resampled_means",
    "seed_means",
]

Array = NDArray[np.floating]
Scores = Sequence[ArrayLike]  # (episodes,) of each seed
RESAMPLES = 5_000
DIGITS = 12
"""Of means. Sums of thirds or sevenths hang on their order in the last digits, and a tie is to be one."""


class Interval(NamedTuple):
    """An estimate and its 95% interval."""

    value: float
    low: float
    high: float

    def columns(self, name: str) -> dict[str, float]:
        """As <name>, <name>_low and <name>_high of a table."""
        return {name: self.value, f"{name}_low": self.low, f"{name}_high": self.high}


def interquartile_mean(values: ArrayLike) -> Array:
    """Mean over the last axis of what is left when floor(n / 4) values are cut at either end.

    With fewer than four values nothing is cut: it is the mean.

    Source: Agarwal et al. 2021, section 4.3.
    """
    ordered = np.sort(_numbers(values), axis=-1)
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
        values, counts = np.unique(_numbers(episodes), return_counts=True)
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
    return np.array([np.mean(_numbers(episodes)) for episodes in scores]).round(DIGITS)


def _numbers(values: ArrayLike) -> Array:
    """The values as floats. A NaN would be sorted out of a mean, or count as a loss, without a word."""
    numbers = np.asarray(values, dtype=float)
    if not np.isfinite(numbers).all():
        raise ValueError(f"statistics need finite numbers, got {numbers[~np.isfinite(numbers)][0]}")
    return numbers


def interval_ends(draws: Array) -> tuple[float, float]:
    """Ends of the 95% percentile interval.

    Raises:
        ValueError: if nothing was drawn.
    """
    if not len(draws):
        raise ValueError("an interval needs at least one resample, got none")
    low, high = np.quantile(draws, (0.025, 0.975))
    return float(low), float(high)


def probability_of_improvement(first: ArrayLike, second: ArrayLike) -> Array:
    """P(X > Y) + P(X = Y) / 2 for X of `first` (..., n) and Y of `second` (..., m).

    Source: Mann and Whitney 1947: U / (n m); Agarwal et al. 2021, section 4.3.
    """
    x, y = _numbers(first), _numbers(second)
    pairs = x[..., :, None] - y[..., None, :]
    return ((pairs > 0) + 0.5 * (pairs == 0)).mean((-2, -1))


def performance_profile(values: ArrayLike, thresholds: ArrayLike) -> Array:
    """Share of the last axis of `values` (..., n) that is above each threshold: (..., thresholds).

    Source: Agarwal et al. 2021, section 4.2 (score distribution).
    """
    found = _numbers(values)[..., None] > np.asarray(thresholds, dtype=float)
    return found.mean(-2)
