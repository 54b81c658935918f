"""Networks that compute in bfloat16 while their parameters, and whatever trains them, stay in float32."""

import torch
from torch import Tensor, nn

__all__ = ["Bfloat16", "in_bfloat16"]


def in_bfloat16(network: nn.Module, rows: Tensor) -> Tensor:
    """network(rows) with matrix products in bfloat16: (..., D) -> (..., E) float32."""
    with torch.autocast(rows.device.type, torch.bfloat16):
        return network(rows).float()


class Bfloat16(nn.Module):
    """A network that always computes so; it has that network's parameters.

    Args:
        network: (..., D) -> (..., E).
    """

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, rows: Tensor) -> Tensor:
        """rows: (..., D) -> (..., E) float32."""
        return in_bfloat16(self.network, rows)
