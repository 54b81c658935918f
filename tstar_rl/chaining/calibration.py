"""How well a score of states tells whether the next skill then succeeds."""

from torch import Tensor

__all__ = ["area_under_curve"]


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
