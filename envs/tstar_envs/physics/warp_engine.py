"""What `warp.py` asks of the libraries: to be there, a model without sensors, and a look without dynamics."""

from __future__ import annotations

import copy
from importlib import import_module
from typing import Any

import mujoco


def libraries() -> tuple[Any, Any]:
    """Warp and mujoco_warp.

    Raises:
        ImportError: the extra `gpu` is not installed.
    """
    try:
        mujoco_warp: Any = import_module("mujoco_warp")  # by name: pyright passes without the extra too
        warp: Any = import_module("warp")
    except ImportError as error:
        raise ImportError(
            "simulating on a GPU (device='cuda', or physics='warp') needs the extra 'gpu': "
            "pip install 'tstar_rl[gpu]', or pip install -e '.[gpu]' in a clone"
        ) from error
    warp.config.log_level = max(warp.config.log_level, warp.LOG_WARNING)  # not a line for every kernel loaded
    warp.init()
    return warp, mujoco_warp


def without_sensors(model: Any) -> Any:
    """Warp's model, its arrays shared, without sensors: nothing reads them between the substeps of a control step."""
    model = copy.copy(model)
    model.opt = copy.copy(model.opt)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_SENSOR.value
    return model


def look(engine: Any, model: Any, data: Any) -> None:
    """What follows from positions and velocities, sensors included, without any dynamics."""
    engine.fwd_kinematics(model, data)
    engine.collision(model, data)
    data.sensordata.zero_()
    engine.sensor_pos(model, data)
    engine.com_vel(model, data)
    engine.sensor_vel(model, data)
