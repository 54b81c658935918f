"""N simulations on a GPU: `mujoco_warp` behind `PhysicsView`. It also runs on Warp's CPU device, for tests.

Warp simulates in single precision; outward every tensor is float64, so that the task computes as it does on the
processor. A float64 tensor and Warp's own array (which torch reads in place) are copied to each other on the device,
once a call, and on a GPU every substep is one launch of a recorded CUDA graph. No state goes through the host; where
the host waits for a truth value, here and in the task, is listed in docs/decisions/0011-gpu-simulator.md.

Guarantee: a restored state has the same future as the uninterrupted one, bit for bit on Warp's CPU device. On a GPU
contacts are found in any order, so two runs agree to rounding only. Rows are laid out as MuJoCo's: a snapshot taken
by one simulator, rounded to single precision, is a start for the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import mujoco
import torch
from torch import Tensor

from tstar_envs.physics.masks import write
from tstar_envs.physics.state_row import row_size, row_slice, side_by_side
from tstar_envs.physics.warp_engine import libraries, look, without_sensors
from tstar_envs.physics.warp_graph import Recorded
from tstar_envs.physics.warp_scene import room, warp_model

_STATE = mujoco.mjtState
_TOO_LARGE = 1e10
"""MuJoCo gives up on a simulation with a position or velocity beyond this."""
CHECKED_EVERY = 32
"""Control steps between two looks at whether contacts were lost: a look makes the host wait for the device."""


class WarpPhysics:
    """`PhysicsView` on `num_sims` simulations on `device`: a CUDA device, or `cpu`.

    Raises:
        ImportError: the extra `gpu` is not installed.
        ValueError: `device` is a CUDA device and there is none.
    """

    steps_together = True

    def __init__(self, model: mujoco.MjModel, num_sims: int, device: str | torch.device = "cuda"):
        self.model, self.num_sims, self.device = model, num_sims, _checked(torch.device(device))
        self._warp, engine = libraries()
        self._place = self._warp.device_from_torch(self.device)
        scene, self.room = warp_model(model), room(model)
        with self._warp.ScopedDevice(self._place):
            self._model = engine.put_model(scene, batch_sizes={"eq_data": num_sims})
            self._data = engine.make_data(
                scene,
                nworld=num_sims,
                nconmax=self.room.contacts,
                njmax=self.room.rows,
                nccdmax=self.room.convex,
            )
            self._warp.synchronize_device()
        self._model.opt.warn_overflow = 0  # an error of our own says it
        if self.device.type == "cuda":
            self._model.opt.graph_conditional = self._warp.is_conditional_graph_supported()
        kinds = engine.OverflowType
        self._cramped = int(kinds.NEFC | kinds.NJMAX_NNZ)
        self._lost = int(kinds.BROADPHASE | kinds.NARROWPHASE | kinds.CCD)
        self._overflow, self._steps = self._raw(self._data.overflow), 0
        state = {name: self._raw(getattr(self._data, name)) for name in ("qpos", "qvel", "ctrl", "eq_active")}
        state["eq_data"] = self._raw(self._model.eq_data)
        self._time, self._warmstart = self._raw(self._data.time), self._raw(self._data.qacc_warmstart)
        self._state = {name: (raw, raw.double()) for name, raw in state.items()}
        self.qpos, self.qvel, self.ctrl, self.eq_active, self.eq_data = (x for _, x in self._state.values())
        self._derived: dict[str, tuple[Tensor, Tensor]] = {}
        self._rows = {c: row_slice(model, c) for c in _COMPONENTS}
        self._start = {name: value.clone() for name, (_, value) in self._state.items()}
        self._sensors = self._follow("sensordata")
        recorded = partial(Recorded, self._warp, self._place, self.device)
        self._substep = recorded(partial(engine.step, without_sensors(self._model), self._data))
        self._derive = recorded(partial(look, engine, self._model, self._data))
        self.clear(torch.ones(num_sims, dtype=torch.bool, device=self.device))
        self.forward()

    def joint_frames(self, count: int) -> tuple[Tensor, Tensor]:
        return self._follow("xanchor")[:, :count], self._follow("xaxis")[:, :count]

    def sensor(self, name: str) -> Tensor:
        sensor = self.model.sensor(name)
        return self._sensors[:, sensor.adr[0] : sensor.adr[0] + sensor.dim[0]]

    def sensors(self, names: Sequence[str]) -> Tensor:
        return self._sensors[:, side_by_side(self.model, names)]

    def step(self, substeps: int, mask: Tensor | None = None) -> Tensor:
        before = None if mask is None else (self.state(), self.eq_data.clone())
        failed, cramped = self._advance(substeps)
        self._steps += 1
        failed = failed | cramped
        if mask is not None and before is not None:
            self.set_state(*before, ~mask)
            failed = failed & mask
        if self._steps % CHECKED_EVERY == 0:
            self.check_room()
        return failed

    def settle(self, mask: Tensor, substeps: int) -> Tensor:
        before, welds = self.state(), self.eq_data.clone()
        failed, cramped = self._advance(substeps)
        self.check_room()
        if bool((cramped & mask).any()):
            raise RuntimeError(
                f"simulation {int((cramped & mask).nonzero()[0])} needs more room than {self.room.rows} constraint "
                f"rows while its parts settle; {_RAISE_IT}"
            )
        self.set_state(before, welds, ~mask)
        return failed & mask

    def check_room(self) -> None:
        """Looks whether a contact was lost, in any simulation at any time; `settle` does, and `step` now and then.

        A simulation without room for its constraint rows fails alone, as one that MuJoCo gives up on. Contacts have
        their room together, and whose are lost is chance: that is an error.

        Raises:
            RuntimeError: contacts were lost.
        """
        if bool((self._overflow & self._lost).any()):
            n, contacts, convex = self.num_sims, self.room.contacts, self.room.convex
            raise RuntimeError(
                f"{n} simulations together need more room than {n * contacts} contacts and {n * convex} convex pairs, "
                f"{contacts} and {convex} for each; {_RAISE_IT}"
            )

    def forward(self, mask: Tensor | None = None) -> None:
        self._push()
        self._refresh()

    def clear(self, mask: Tensor) -> None:
        for name, (_, value) in self._state.items():
            write(value, self._start[name], mask)
        for raw in (self._warmstart, self._time):
            write(raw, torch.zeros_like(raw), mask)

    def state(self) -> Tensor:
        rows = torch.zeros(self.num_sims, row_size(self.model), dtype=torch.float64, device=self.device)
        for component, part in zip(_COMPONENTS, self._parts(), strict=True):
            rows[:, self._rows[component]] = part.reshape(self.num_sims, -1).double()
        return rows

    def set_state(self, rows: Tensor, welds: Tensor, mask: Tensor | None = None) -> None:
        if mask is None:
            mask = torch.ones(self.num_sims, dtype=torch.bool, device=self.device)
        for component, part in zip(_COMPONENTS, self._parts(), strict=True):
            write(part, rows[:, self._rows[component]].reshape(part.shape), mask)
        write(self.eq_data, welds, mask)
        self.forward(mask)

    def close(self) -> None:
        self._substep = self._derive = _closed
        self._model = self._data = None
        self._time, self._warmstart, self._overflow = (
            raw.clone() for raw in (self._time, self._warmstart, self._overflow)
        )
        self._state = {name: (value, value) for name, (_, value) in self._state.items()}
        self._derived = {name: (value, value) for name, (_, value) in self._derived.items()}

    def _parts(self) -> tuple[Tensor, ...]:
        return self._time, self.qpos, self.qvel, self._warmstart, self.ctrl, self.eq_active

    def _raw(self, array: Any) -> Tensor:
        return self._warp.to_torch(array, requires_grad=False)

    def _follow(self, name: str) -> Tensor:
        """A derived field of Warp's data as a float64 tensor that every later call brings up to date."""
        if name not in self._derived:
            raw = self._raw(getattr(self._data, name))
            self._derived[name] = raw, raw.double()
        return self._derived[name][1]

    def _push(self) -> None:
        for raw, value in self._state.values():
            raw.copy_(value)

    def _refresh(self) -> None:
        self._derive()
        for raw, value in self._derived.values():
            value.copy_(raw)

    def _advance(self, substeps: int) -> tuple[Tensor, Tensor]:
        """Steps; (N,) each, which simulations are no longer sound, and which had no room for their constraint rows."""
        self._push()
        for _ in range(substeps):
            self._substep()
        for name in ("qpos", "qvel"):
            raw, value = self._state[name]
            value.copy_(raw)
        self._refresh()
        cramped = (self._overflow & self._cramped) != 0
        self._overflow &= ~self._cramped
        sound = (self.qpos.abs() < _TOO_LARGE).all(-1) & (self.qvel.abs() < _TOO_LARGE).all(-1)  # NaN is not
        return ~sound, cramped


_COMPONENTS = (
    _STATE.mjSTATE_TIME,
    _STATE.mjSTATE_QPOS,
    _STATE.mjSTATE_QVEL,
    _STATE.mjSTATE_WARMSTART,
    _STATE.mjSTATE_CTRL,
    _STATE.mjSTATE_EQ_ACTIVE,
)
"""What a row holds of these scenes; forces applied from outside, which nothing here uses, stay zero."""
_RAISE_IT = (
    "`room` in tstar_envs/physics/warp_scene.py estimates it from the scene: raise it for this furniture"
)


def _closed() -> None:
    raise RuntimeError("these simulations were closed: their memory on the device is free; make new ones")


def _checked(device: torch.device) -> torch.device:
    if device.type != "cuda":
        return device
    if not torch.cuda.is_available():
        raise ValueError(
            f"device {str(device)!r} was asked for, but torch finds no CUDA device; device='cpu' simulates with "
            "MuJoCo, and physics='warp' beside it with the GPU's simulator on the processor (slowly: for tests)"
        )
    if (device.index or 0) >= (count := torch.cuda.device_count()):
        raise ValueError(f"device {str(device)!r} was asked for; torch finds cuda:0 to cuda:{count - 1}")
    return torch.device("cuda", torch.cuda.current_device() if device.index is None else device.index)
