"""Where things lie: parts of a state in a row of MuJoCo's integration state, the row of every snapshot; sensors."""

from __future__ import annotations

from collections.abc import Sequence

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


def side_by_side(model: mujoco.MjModel, names: Sequence[str]) -> slice:
    """Where the readings of sensors lie that follow each other in the model.

    Raises:
        ValueError: they do not.
    """
    first = end = int(model.sensor(names[0]).adr[0])
    for name in names:
        sensor = model.sensor(name)
        if int(sensor.adr[0]) != end:
            raise ValueError(f"sensor {name!r} does not follow the one before it in {', '.join(names)}")
        end += int(sensor.dim[0])
    return slice(first, end)
