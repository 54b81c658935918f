"""One simulation in an MjData that belongs to somebody else, behind `PhysicsView`: dm_control's physics holds one.

The MjData is the simulation: what others write into it counts, what they read from it is current. The same bits as a
row of `physics.cpu`, after a restore as well.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
import torch
from torch import Tensor

from tstar_envs.physics.state_row import row_size, row_slice, side_by_side

_STATE = mujoco.mjtState
_ROW = _STATE.mjSTATE_INTEGRATION.value


class SinglePhysics:
    """`PhysicsView` of one simulation: `data` on `model`, whose weld poses (`eq_data`) are this simulation's own.

    The state is a row, as in MuJoCo's batch: it is loaded before each call and saved after it. Loading it tells MuJoCo
    what was written, which wakes parts that sleep. What others wrote into `data` meanwhile joins it then, or in
    `catch_up`.
    """

    steps_together = False

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData):
        self.model, self.data = model, data
        self.num_sims, self.device = 1, torch.device("cpu")
        self._row, self._saved, self._found = (np.empty(row_size(model)) for _ in range(3))
        self._save()
        self._current = False
        """Whether positions, velocities and their sensors are those of the state."""
        self._warned, self._broken = data.warning.number.copy(), False
        """What MuJoCo had warned of after the last step, and whether it gave up since: the next step says so."""
        self._controls = row_slice(model, _STATE.mjSTATE_CTRL)
        rows = torch.from_numpy(self._row).unsqueeze(0)
        parts = (_STATE.mjSTATE_QPOS, _STATE.mjSTATE_QVEL, _STATE.mjSTATE_CTRL, _STATE.mjSTATE_EQ_ACTIVE)
        self.qpos, self.qvel, self.ctrl, self.eq_active = (rows[:, row_slice(model, part)] for part in parts)
        self.eq_data = _shared(model.eq_data)
        self.compiled_welds = self.eq_data.clone()
        """What `clear` puts the weld poses back to, (1, welds, W)."""
        self._sensors = _shared(data.sensordata)

    def joint_frames(self, count: int) -> tuple[Tensor, Tensor]:
        return _shared(self.data.xanchor)[:, :count], _shared(self.data.xaxis)[:, :count]

    def sensor(self, name: str) -> Tensor:
        return self.sensors((name,))

    def sensors(self, names: Sequence[str]) -> Tensor:
        return self._sensors[:, side_by_side(self.model, names)]

    def step(self, substeps: int, mask: Tensor | None = None) -> Tensor:
        if mask is not None and not bool(mask[0]):
            return torch.zeros(1, dtype=torch.bool)
        self._load()
        failed, self._broken = self._broken, False
        try:
            if self._current:  # the first half of the first substep has been done
                mujoco.mj_step2(self.model, self.data)
                substeps -= 1
            if substeps:
                mujoco.mj_step(self.model, self.data, substeps)
            mujoco.mj_step1(
                self.model, self.data
            )  # positions, velocities and their sensors are current again
        except mujoco.FatalError:
            failed = True
        self._save()
        failed = failed or bool((self.data.warning.number != self._warned).any())
        self._warned = self.data.warning.number.copy()
        failed = failed or not (np.isfinite(self.data.qpos).all() and np.isfinite(self.data.qvel).all())
        return torch.tensor([failed])

    def settle(self, mask: Tensor, substeps: int) -> Tensor:
        return self.step(substeps, mask)

    def forward(self, mask: Tensor | None = None) -> None:
        if mask is None or bool(mask[0]):
            self._load()
            try:
                mujoco.mj_step1(self.model, self.data)
            except mujoco.FatalError:
                self._broken = True
            self._save()

    def clear(self, mask: Tensor) -> None:
        if bool(mask[0]):
            mujoco.mj_resetData(self.model, self.data)
            self._warned, self._broken = self.data.warning.number.copy(), False
            self.eq_data.copy_(self.compiled_welds)
            self._save()
            self._current = False

    def catch_up(self) -> None:
        """Takes what others wrote into `data` since the last call into the state."""
        mujoco.mj_getState(self.model, self.data, self._found, _ROW)
        written = self._found != self._saved
        self._row[written] = self._saved[written] = self._found[written]
        written[self._controls] = False
        if written.any():
            self._current = False

    def refresh(self) -> None:
        """Makes positions, velocities and their sensors those of the state, where others have written into `data`."""
        self.catch_up()
        if not self._current:
            self.forward()

    def state(self) -> Tensor:
        self.catch_up()
        return torch.from_numpy(self._row.copy()).unsqueeze(0)

    def set_state(self, rows: Tensor, welds: Tensor, mask: Tensor | None = None) -> None:
        if mask is None or bool(mask[0]):
            self.clear(torch.ones(1, dtype=torch.bool))
            self._row[:] = rows[0]
            self.eq_data.copy_(welds)
            self.forward()

    def close(self) -> None:
        pass  # the MjData is its owner's

    def _load(self) -> None:
        self.catch_up()
        if (self._row != self._found).any():
            mujoco.mj_setState(self.model, self.data, self._row, _ROW)
        changed = self._row != self._saved
        changed[self._controls] = False
        if changed.any():
            self._current = False

    def _save(self) -> None:
        self._current = True
        mujoco.mj_getState(self.model, self.data, self._row, _ROW)
        self._saved[:] = self._row


def _shared(array: np.ndarray) -> Tensor:
    """The array as a batch of one, on the same memory."""
    return torch.from_numpy(array).unsqueeze(0)
