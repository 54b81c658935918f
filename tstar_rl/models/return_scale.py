"""The running deviation of discounted returns, by which rewards are scaled."""

import torch
from torch import Tensor, nn


class ReturnScale(nn.Module):
    """The running deviation of discounted returns, by which rewards are divided."""

    count: Tensor
    mean: Tensor
    var: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("count", torch.zeros((), dtype=torch.float64))
        self.register_buffer("mean", torch.zeros((), dtype=torch.float64))
        self.register_buffer("var", torch.ones((), dtype=torch.float64))

    @property
    def deviation(self) -> Tensor:
        """Scalar, by which rewards are divided; 1 while all returns were alike."""
        return torch.where(self.var > 0, self.var.sqrt().clamp_min(1e-8), 1.0)

    @torch.no_grad()
    def forward(self, reward: Tensor, done: Tensor, carried: Tensor, gamma: float) -> tuple[Tensor, Tensor]:
        """reward, done: (N, T, 1), carried: (N, 1) returns so far -> scaled reward (N, T, 1), carried (N, 1)."""
        returns = []
        for t in range(reward.shape[1]):
            carried = carried * gamma + reward[:, t]
            returns.append(carried)
            carried = carried * ~done[:, t]
        self._update(torch.stack(returns, 1).double())
        return (reward / self.deviation).to(reward.dtype), carried

    def _update(self, rows: Tensor) -> None:
        total = self.count + rows.numel()
        share, step = rows.numel() / total, rows.mean() - self.mean
        var = rows.var(unbiased=False)
        self.var.copy_((1 - share) * self.var + share * var + share * (1 - share) * step.square())
        self.mean.add_(share * step)
        self.count.copy_(total)
