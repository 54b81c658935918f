"""The hand-over gap of one chain with its interval: what its skills would do, minus what they do.

Source: docs/experiments/regimes.md.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tstar_rl.analysis.statistics import RESAMPLES, Interval, interval_ends, resampled_means

__all__ = ["chain_interval", "gap_interval", "product_interval", "product_of_skills"]


def product_of_skills(own_success: Sequence[float]) -> float:
    """Progress of a chain whose skills succeed as often from where the one before ends as from their own starts.

    Subtask k is then completed with probability p_0 ... p_k; progress is the mean of these products.
    """
    return float(np.cumprod(np.asarray(own_success, dtype=float)).mean())


def product_interval(
    successes: Sequence[int], episodes: int, rng: np.random.Generator, resamples: int = RESAMPLES
) -> Interval:
    """Progress of a chain whose skills succeed as often from where the one before ends as from their own starts.

    Args:
        successes: of each skill from its own starts, in order.
        episodes: of each skill.
        rng: draws the skills' shares, each apart.
        resamples: of the bootstrap.
    """
    shares = np.asarray(successes, dtype=float) / _number(episodes)
    return _interval(product_of_skills(list(shares)), _products(shares, episodes, rng, resamples))


def chain_interval(progress: ArrayLike, rng: np.random.Generator, resamples: int = RESAMPLES) -> Interval:
    """Mean progress (episodes,) of a chain, episodes drawn with replacement."""
    values = np.asarray(progress, dtype=float)
    _number(values.size)
    return _interval(float(values.mean()), _means(values, rng, resamples))


def gap_interval(
    successes: Sequence[int],
    episodes: int,
    progress: ArrayLike,
    rng: np.random.Generator,
    resamples: int = RESAMPLES,
) -> Interval:
    """The product minus the chain's progress; the episodes of both are drawn apart from each other.

    Args:
        successes, episodes: see `product_interval`.
        progress: (episodes,) of the chain, each the share of its subtasks that was done.
        rng: draws the shares and the chain's episodes.
        resamples: of the bootstrap.
    """
    shares, values = np.asarray(successes, dtype=float) / _number(episodes), np.asarray(progress, dtype=float)
    _number(values.size)
    draws = _products(shares, episodes, rng, resamples) - _means(values, rng, resamples)
    return _interval(product_of_skills(list(shares)) - float(values.mean()), draws)


def _products(
    shares: NDArray[np.floating], episodes: int, rng: np.random.Generator, resamples: int
) -> NDArray[np.floating]:
    """(resamples,): each skill's share is drawn from what so many successes leave likely, a Beta with Jeffreys' prior.

    Episodes drawn with replacement would say that a skill without a failure never fails.

    Source: Brown, Cai and DasGupta, Interval Estimation for a Binomial Proportion, 2001.
    """
    done = shares * episodes
    drawn = rng.beta(done + 0.5, episodes - done + 0.5, size=(resamples, len(shares)))
    return drawn.cumprod(-1).mean(-1)


def _means(values: NDArray[np.floating], rng: np.random.Generator, resamples: int) -> NDArray[np.floating]:
    """(resamples,)."""
    return resampled_means([values], np.zeros((resamples, 1), dtype=np.int64), rng).squeeze(-1)


def _interval(value: float, draws: NDArray[np.floating]) -> Interval:
    """The draws' interval, up to the value itself, which lies beyond them where all succeeded or all failed."""
    low, high = interval_ends(draws)
    return Interval(value, min(low, value), max(high, value))


def _number(episodes: int) -> int:
    if episodes < 1:
        raise ValueError(f"a hand-over gap needs at least one episode, got {episodes}")
    return episodes
