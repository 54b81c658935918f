"""N simulations on the CPU: `mujoco.batch.Batch` behind `PhysicsView`, as zero-copy torch views."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Sequence
from typing import NoReturn

import mujoco
import numpy as np
import torch
from mujoco import batch as mj_batch
from torch import Tensor

from tstar_envs.physics.state_row import row_slice, side_by_side

_CURRENT = mujoco.mjtStage.mjSTAGE_VEL.value
"""Stage computed after every call: positions, velocities and their sensors (not accelerations)."""


class CpuPhysics:
    """`PhysicsView` on `num_sims` simulations stepped by `nthread` threads (0: all cores).

    Results are the same bits at any thread count. MuJoCo keeps one MjData per simulation, as sleep needs.
    """

    steps_together = False

    def __init__(self, model: mujoco.MjModel, num_sims: int, nthread: int = 0):
        self.model = model
        self.num_sims = num_sims
        self.device = torch.device("cpu")
        self.batch = mj_batch.Batch(model, nsim=num_sims, nthread=nthread, persistent=True)
        self.qpos = torch.from_numpy(self.batch.qpos)
        self.qvel = torch.from_numpy(self.batch.qvel)
        self.ctrl = torch.from_numpy(self.batch.ctrl)
        self.eq_active = torch.from_numpy(self.batch.eq_active)
        self.eq_data = torch.from_numpy(self.batch.expand("eq_data"))
        self._state = torch.from_numpy(self.batch.state)
        self._sensors = _shared(self.batch.bind("sensordata"))
        self._warnings = self.batch.warning.copy()
        first = row_slice(model, mujoco.mjtState.mjSTATE_QPOS).start
        last = row_slice(model, mujoco.mjtState.mjSTATE_QVEL).stop
        self._moving = self.batch.state[:, first:last]  # positions and velocities
        self.batch.forward(stage=_CURRENT)

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            "batched simulations are not copied or pickled: make an environment of the same arguments, in the process "
            "that steps it, and restore(snapshot) there"
        )

    def joint_frames(self, count: int) -> tuple[Tensor, Tensor]:
        """World anchors and axes of the first `count` joints, (N, count, 3) each; for the scripted expert."""
        anchors, axes = _shared(self.batch.bind("xanchor")), _shared(self.batch.bind("xaxis"))
        self.forward()  # what is bound between two calls is zero until the next one
        return anchors[:, :count], axes[:, :count]

    def sensor(self, name: str) -> Tensor:
        sensor = self.model.sensor(name)
        return self._sensors[:, sensor.adr[0] : sensor.adr[0] + sensor.dim[0]]

    def sensors(self, names: Sequence[str]) -> Tensor:
        return self._sensors[:, side_by_side(self.model, names)]

    def step(self, substeps: int, mask: Tensor | None = None) -> Tensor:
        if mask is None:
            return self._advance(None, substeps)
        return self._advance(mask.numpy(), substeps) & mask

    def settle(self, mask: Tensor, substeps: int) -> Tensor:
        return self.step(substeps, mask)

    def forward(self, mask: Tensor | None = None) -> None:
        # An error leaves the state untouched: the next step meets it again and reports it as a failure.
        with contextlib.suppress(mj_batch.SimulationError):
            self.batch.forward(ids=None if mask is None else mask.numpy(), stage=_CURRENT)

    def clear(self, mask: Tensor) -> None:
        self.batch.reset(ids=mask.numpy(), stage=mujoco.mjtStage.mjSTAGE_NONE.value)
        self.eq_data[mask] = torch.from_numpy(self.model.eq_data)
        # The reset zeroes the counters: without this the next step would take the change for a new failure.
        self._warnings[mask.numpy()] = self.batch.warning[mask.numpy()]

    def state(self) -> Tensor:
        return self._state.clone()

    def set_state(self, rows: Tensor, welds: Tensor, mask: Tensor | None = None) -> None:
        if mask is None:
            mask = torch.ones(self.num_sims, dtype=torch.bool)
        # A reset first: sleep timers are not in the row, so two restores of one row would differ without it.
        self.clear(mask)
        self._state[mask] = rows[mask]
        self.eq_data[mask] = welds[mask]
        self.forward(mask)

    def close(self) -> None:
        pass  # the tensors are the simulations: they go together

    def _advance(self, ids: np.ndarray | None, substeps: int) -> Tensor:
        failed = np.zeros(self.num_sims, dtype=bool)
        try:
            self.batch.step(ids=ids, nstep=substeps, stage=_CURRENT)
        except mj_batch.SimulationError as error:
            failed[error.ids] = True
        warnings_now = self.batch.warning
        if (warnings_now != self._warnings).any():
            failed |= (warnings_now != self._warnings).reshape(self.num_sims, -1).any(axis=1)
            self._warnings = warnings_now.copy()
        if not np.isfinite(self._moving).all():
            failed |= ~np.isfinite(self._moving).all(axis=1)
        return torch.from_numpy(failed)


def _shared(array: np.ndarray) -> Tensor:
    """A tensor on the memory of a read-only NumPy array; torch has no read-only tensors and warns of it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return torch.from_numpy(array)
