"""How rows are divided into the minibatches of an epoch."""

import math

from torch import Tensor

__all__ = ["nearly_equal"]


def nearly_equal(order: Tensor, minibatch: int) -> tuple[Tensor, ...]:
    """Splits rows (n,) into as few parts of at most `minibatch` as there can be, whose sizes differ by one at most.

    A remainder of a few rows would get a whole step of the optimisers, and in PPO its KL would decide the next rate.
    """
    return order.tensor_split(max(math.ceil(len(order) / minibatch), 1))
