"""What makes observations comparable before a network reads them."""

import torch
from torch import Tensor, nn

from tstar_rl.checks import InvalidValueError

__all__ = ["Normalizer", "Standardizer"]


class Normalizer(nn.Module):
    """Shifts and scales observations to zero mean and unit deviation, and clips them.

    The deviation is floored: a dimension that hardly moved in the data (a preassembled part) must not turn a
    millimetre into ten deviations later. Until it is fitted it passes observations through, clipped.

    Args:
        obs_dim: size of an observation.
        clip: largest absolute value that comes out.
    """

    loc: Tensor
    scale: Tensor
    var: Tensor
    count: Tensor

    def __init__(self, obs_dim: int, clip: float = 10.0) -> None:
        super().__init__()
        self.clip = clip
        self.register_buffer("loc", torch.zeros(obs_dim))
        self.register_buffer("scale", torch.ones(obs_dim))
        self.register_buffer("var", torch.ones(obs_dim))
        self.register_buffer("count", torch.zeros(()))

    def forward(self, obs: Tensor) -> Tensor:
        """obs: (..., obs_dim) -> the same shape, within [-clip, clip]."""
        return ((obs - self.loc) / self.scale).clamp(-self.clip, self.clip)

    @torch.no_grad()
    def fit(self, obs: Tensor, floor: float = 0.02) -> None:
        """Sets the statistics to those of obs (..., obs_dim), forgetting what was there; raises what `update` does."""
        self.count.zero_()
        self.update(obs, floor)

    @torch.no_grad()
    def update(self, obs: Tensor, floor: float = 0.02) -> None:
        """Adds obs (..., obs_dim) to the running statistics, in place (Chan's parallel form of Welford's).

        Raises:
            ValueError: if the observations are of another size, or the floor is not positive.
        """
        _check_floor(floor)
        if obs.shape[-1] != len(self.loc):
            raise ValueError(
                f"observations of {len(self.loc)} numbers are normalised here, got {obs.shape[-1]}: are they of "
                "furniture with another number of parts?"
            )
        rows = obs.reshape(-1, len(self.loc)).to(self.loc)
        if rows.shape[0] == 0:
            return
        total = self.count + rows.shape[0]
        share = rows.shape[0] / total
        step = rows.mean(0) - self.loc
        batch_var = rows.var(0, unbiased=False)
        self.var.copy_((1 - share) * self.var + share * batch_var + share * (1 - share) * step.square())
        self.loc.add_(share * step)
        self.count.copy_(total)
        self.scale.copy_(self.var.sqrt().clamp_min(floor))

    def floor_found(self) -> float | None:
        """The floor that it was fitted with; None: no input varied less, so it cannot be told."""
        raised = self.scale[self.var.sqrt() < self.scale]
        return float(raised.min()) if len(raised) else None

    @torch.no_grad()
    def raise_to(self, floor: float) -> int:
        """Raises the deviations below `floor` to it, after the fact; returns how many there were.

        The networks behind see the same as before of every input that varied more than that when it was fitted. `fit`
        and `update` undo it.

        Raises:
            ValueError: if the floor is not positive.
        """
        _check_floor(floor)
        below = int((self.scale < floor).sum())
        self.scale.clamp_(min=floor)
        return below

    @torch.no_grad()
    def widen(self, obs: Tensor) -> int:
        """Raises the deviations to those of obs (..., obs_dim) around the mean that is there; returns how many rose.

        The networks behind see the same as before of every input that varied more than that when it was fitted. Without
        any observations nothing is changed. `fit` and `update` undo it, and `floor_found` takes what rose for a floor.
        """
        if not obs.numel():
            return 0
        rows = obs.reshape(-1, obs.shape[-1]).to(self.loc)
        found = (rows - self.loc).square().mean(0).sqrt()
        wider = int((found > self.scale).sum())
        self.scale.copy_(torch.maximum(self.scale, found))
        return wider


class Standardizer(Normalizer):
    """A normaliser of one network's own, fitted to the states that the network learns from.

    A skill's normaliser has a floor that suits its policy: small differences of two terminal states vanish under it. A
    network that is to tell such states apart needs a lower one.

    Args:
        obs_dim: size of an observation.
        floor: least deviation, in the units of the observation.

    Raises:
        ValueError: if the floor is not positive.
    """

    floor: Tensor

    def __init__(self, obs_dim: int, floor: float) -> None:
        _check_floor(floor)
        super().__init__(obs_dim)
        self.register_buffer("floor", torch.tensor(floor, dtype=torch.float64))

    def standardize(self, obs: Tensor) -> None:
        """Sets the statistics to those of obs (..., obs_dim); raises what `update` does."""
        self.fit(obs, float(self.floor))


def _check_floor(floor: float) -> None:
    if not floor > 0:
        raise InvalidValueError(f"a floor must be positive, got {floor}")
