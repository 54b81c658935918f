"""How well a score of states tells whether the next skill then succeeds."""

from typing import NamedTuple

import torch
from torch import Tensor

__all__ = [
    "Reliability",
    "area_under_curve",
    "brier_score",
    "expected_calibration_error",
    "reliability_curve",
]

BINS = 10


def area_under_curve(scores: Tensor, outcomes: Tensor) -> float:
    """The probability that a random success scores higher than a random failure; ties count half.

    Args:
        scores: (n,), higher should mean success.
        outcomes: (n,) bool.

    Returns:
        In [0, 1]: 0.5 tells nothing. NaN if all outcomes are the same.

    Source: Hanley and McNeil 1982; the Mann-Whitney statistic over its largest value.
    """
    won, lost = scores[outcomes], scores[~outcomes]
    if not len(won) or not len(lost):
        return float("nan")
    difference = won.double().unsqueeze(-1) - lost.double()
    return float(((difference > 0).double() + 0.5 * (difference == 0).double()).mean())


def brier_score(scores: Tensor, outcomes: Tensor) -> float:
    """The mean squared distance of scores (n,) in [0, 1] from what happened, (n,) in [0, 1].

    Returns:
        In [0, 1], the less the better. Where outcomes are 0 or 1, saying their mean p of every state has p (1 - p). NaN
        if n is 0.

    Source: Brier 1950.
    """
    return float((scores.double() - outcomes.double()).square().mean())


class Reliability(NamedTuple):
    """States in bins of their scores; a bin without any is left out.

    Attributes:
        score: (b,), the mean score of each bin.
        outcome: (b,), the mean of what happened.
        count: (b,) int64, states.
    """

    score: Tensor
    outcome: Tensor
    count: Tensor


def reliability_curve(scores: Tensor, outcomes: Tensor, bins: int = BINS) -> Reliability:
    """What happened, against what was said: on the diagonal where a score is a probability.

    Args:
        scores: (n,) in [0, 1].
        outcomes: (n,) in [0, 1].
        bins: of equal width; a score on an edge belongs to the bin above, 1 to the last.

    Raises:
        ValueError: if a score is outside [0, 1] or NaN, or there is no bin.

    Source: Murphy and Winkler 1977.
    """
    if bins < 1:
        raise ValueError(f"a reliability curve needs at least 1 bin, got {bins}")
    if wrong := scores[~((scores >= 0) & (scores <= 1))].tolist():
        raise ValueError(
            f"a reliability curve needs scores in [0, 1], got {len(wrong)} of {len(scores)} others, as {wrong[0]:g}"
        )
    scores, outcomes = scores.double(), outcomes.double()
    place = (scores * bins).long().clamp(max=bins - 1)
    count = torch.bincount(place, minlength=bins)
    filled = count > 0
    sums = (torch.bincount(place, weights=each, minlength=bins)[filled] for each in (scores, outcomes))
    score, outcome = (each / count[filled] for each in sums)
    return Reliability(score, outcome, count[filled])


def expected_calibration_error(curve: Reliability) -> float:
    """The mean distance of a reliability curve from the diagonal, bins weighed by their states; NaN if there are none.

    Source: Naeini et al. 2015.
    """
    distance = (curve.score - curve.outcome).abs() * curve.count
    return float(distance.sum() / curve.count.sum())
