"""Success on either side of one number: whether what decides an outcome is a choice between two ways.

A leg, say, can be held with the wrist turned either way. Then the wrist's angle lies in two heaps, and a mean, or an
area under the curve, hides that one heap succeeds and the other never does.

Source: the threshold is that of Otsu, A threshold selection method from gray-level histograms, 1979, on the numbers
themselves.
"""

import math
from typing import NamedTuple

import torch
from torch import Tensor

__all__ = ["Sides", "two_sides"]


class Sides(NamedTuple):
    """States on either side of a number, and how often each side succeeds; all nan where all have one number."""

    split: float
    """In the number's own unit: between the heaps, if there are two. It is found whether there are or not."""
    below: float
    """Share of the states that lie below."""
    succeeded_below: float
    succeeded_above: float


def two_sides(values: Tensor, outcomes: Tensor) -> Sides:
    """Splits states where their heaps lie furthest apart. Outcomes have no say in where.

    Args:
        values: (n,), one number of each state.
        outcomes: (n,) bool.
    """
    ordered = values.double().sort().values
    n = len(ordered)
    if n < 2 or ordered[0] == ordered[-1]:
        return Sides(math.nan, math.nan, math.nan, math.nan)
    lower = torch.arange(1, n, dtype=torch.float64)
    sums = ordered.cumsum(0)
    apart = (sums[:-1] / lower - (sums[-1] - sums[:-1]) / (n - lower)).square() * lower * (n - lower)
    best = int(torch.where(ordered[1:] > ordered[:-1], apart, -1.0).argmax())
    split = float(ordered[best : best + 2].mean())
    below = values.double() < split
    shares = [float(outcomes[side].double().mean()) for side in (below, ~below)]
    return Sides(split, float(below.double().mean()), *shares)
