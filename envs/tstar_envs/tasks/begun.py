"""Which simulations have an episode: one that has none must not be stepped."""

from __future__ import annotations

from torch import Tensor


class Begun:
    """Remembers where episodes were begun; costs nothing once there is one everywhere.

    Args:
        name: of the furniture.
        every: (N,) bool, all True, on the device of the simulations.
    """

    def __init__(self, name: str, every: Tensor):
        self.name = name
        self._left: Tensor | None = every

    def add(self, mask: Tensor) -> None:
        """An episode begins in the simulations of `mask` (N,)."""
        if self._left is not None:
            left = self._left & ~mask
            self._left = left if bool(left.any()) else None

    def remove(self, mask: Tensor) -> None:
        """The simulations of `mask` (N,) are put back to where no episode was begun."""
        if bool(mask.any()):
            self._left = mask.clone() if self._left is None else self._left | mask

    def check(self, running: Tensor | None) -> None:
        """Raises a ValueError if one of the simulations `running` (N,), by default of all, has no episode."""
        if self._left is None:
            return
        early = self._left if running is None else self._left & running
        if bool(early.any()):
            raise ValueError(
                f"no episode of {self.name} was begun in simulation {early.nonzero()[0].item()}: call reset() first"
            )
