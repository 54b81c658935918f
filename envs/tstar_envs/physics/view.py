"""What every simulator offers the task: N simulations of one model as torch tensors with a leading axis N."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import mujoco
import torch
from torch import Tensor


class PhysicsView(Protocol):
    """N simulations. State tensors are live: writing one is the simulations' state at the next call.

    Derived quantities (sensors) are current after `step`, `settle`, `forward` and `set_state`, and read-only.
    All tensors are float64 on `device`. Lengths in m, angles in rad, world frame, quaternions (w, x, y, z).
    """

    model: mujoco.MjModel
    num_sims: int
    device: torch.device
    steps_together: bool  # advancing some simulations costs as much as advancing all of them
    qpos: Tensor  # (N, nq)
    qvel: Tensor  # (N, nv)
    ctrl: Tensor  # (N, nu)
    eq_active: Tensor  # (N, num_welds), 0 or 1
    eq_data: (
        Tensor  # (N, num_welds, W): anchor 3, relative position 3, relative quaternion 4, then torque scale
    )

    def joint_frames(self, count: int) -> tuple[Tensor, Tensor]:
        """World anchors and axes of the first `count` joints, (N, count, 3) each."""
        ...

    def sensor(self, name: str) -> Tensor:
        """Readings of a sensor, (N, dim)."""
        ...

    def sensors(self, names: Sequence[str]) -> Tensor:
        """Readings of sensors that lie side by side in the model, in this order, (N, sum of dims); a live view."""
        ...

    def step(self, substeps: int, mask: Tensor | None = None) -> Tensor:
        """Advances the simulations of `mask` (N,), by default all; returns the mask (N,) of those that failed.

        Raises:
            RuntimeError: on a GPU, where contacts of some simulation were lost. It is looked for now and then.
        """
        ...

    def forward(self, mask: Tensor | None = None) -> None:
        """Makes derived quantities current after a write to the state, in the simulations of `mask` (N,)."""
        ...

    def settle(self, mask: Tensor, substeps: int) -> Tensor:
        """Advances the simulations of `mask` while parts come to rest; returns the mask (N,) of those that failed.

        Raises:
            RuntimeError: on a GPU, where there is too little room for parts at rest; it is looked for each time.
        """
        ...

    def clear(self, mask: Tensor) -> None:
        """Puts the simulations of `mask` back to the model's default state, without computing anything."""
        ...

    def state(self) -> Tensor:
        """Copy of the integration states, (N, S)."""
        ...

    def set_state(self, rows: Tensor, welds: Tensor, mask: Tensor | None = None) -> None:
        """Restores states (N, S) and weld poses (N, num_welds, W) in the simulations of `mask`."""
        ...

    def close(self) -> None:
        """Frees what the simulator holds on a device; they can then be read, not stepped. May be repeated."""
        ...
