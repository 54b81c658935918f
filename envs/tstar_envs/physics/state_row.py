"""Where the parts of a simulation's state lie in a row of MuJoCo's integration state, the row of every snapshot."""

from __future__ import annotations

import mujoco

_FULL = mujoco.mjtState.mjSTATE_INTEGRATION


def row_size(model: mujoco.MjModel) -> int:
    """Numbers S in a row."""
    return mujoco.mj_stateSize(model, _FULL.value)


def row_slice(model: mujoco.MjModel, component: mujoco.mjtState) -> slice:
    """Where a component lies in the row."""
    before = sum(
        mujoco.mj_stateSize(model, 1 << bit)
        for bit in range(component.value.bit_length() - 1)
        if _FULL.value & (1 << bit)
    )
    return slice(before, before + mujoco.mj_stateSize(model, component.value))
