"""Writing some simulations' rows in place."""

from __future__ import annotations

import torch
from torch import Tensor


def write(target: Tensor, value: Tensor, mask: Tensor) -> None:
    """Writes `value` into `target` (N, ...) in the rows of `mask` (N,) bool; `value` may be rows, or one for all.

    `target[mask] = value[mask]` would make a GPU tell the host how many rows there are, and wait for it.
    """
    where = mask.reshape(-1, *[1] * (target.ndim - 1))
    target.copy_(torch.where(where, value.to(target.dtype), target))
