"""Draws of torch's global generators that leave them as they were."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch

__all__ = ["generators_stay"]


@contextmanager
def generators_stay(device: torch.device | str = "cpu") -> Iterator[None]:
    """Leaves torch's global generators, that of the CPU and that of a GPU, as they were before the block.

    Args:
        device: on which the block draws.
    """
    device = torch.device(device)
    with torch.random.fork_rng(devices=[device] if device.type == "cuda" else []):
        yield
