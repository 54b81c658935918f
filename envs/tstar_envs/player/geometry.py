"""The bodies and geoms of a model as plain values, for a page that draws them."""

from __future__ import annotations

import base64
from typing import Any

import mujoco
import numpy as np

SHAPES = {
    mujoco.mjtGeom.mjGEOM_PLANE: "plane",
    mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_BOX: "box",
}
DRAWN_GROUPS = (0, 1, 2)
"""Groups that MuJoCo's own viewers draw unless they are told otherwise."""


def moving_bodies(model: mujoco.MjModel) -> np.ndarray:
    """Indices of the bodies that are not fixed to the world, in the model's order."""
    return np.flatnonzero(model.body_weldid != 0)


def scene(model: mujoco.MjModel) -> dict[str, Any]:
    """What is drawn of `model`, as plain values.

    Returns:
        `bodies`: names of those that move. `geoms`: each with its shape, MuJoCo's half-sizes (m), the index of its body
        in `bodies` or -1 where it stands still, its pose in that body's frame (or the world's), colour and shine.

    Raises:
        ValueError: a geom has a shape that the page cannot draw.
    """
    moving = moving_bodies(model).tolist()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    drawn = [
        g for g in range(model.ngeom) if model.geom_group[g] in DRAWN_GROUPS and _colour(model, g)[3] > 0
    ]
    return {
        "bodies": [model.body(body).name for body in moving],
        "geoms": [_geom(model, data, geom, moving) for geom in drawn],
    }


def packed(values: np.ndarray) -> str:
    """Numbers as base64 of little-endian float32, in C order."""
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode("ascii")


def _geom(model: mujoco.MjModel, data: mujoco.MjData, geom: int, moving: list[int]) -> dict[str, Any]:
    kind = mujoco.mjtGeom(model.geom_type[geom])
    if kind not in SHAPES:
        name = model.geom(geom).name or f"number {geom}"
        raise ValueError(
            f"geom {name} is a {kind.name.removeprefix('mjGEOM_').lower()}, which the player cannot draw; "
            f"it draws {', '.join(SHAPES.values())}"
        )
    body = int(model.geom_bodyid[geom])
    still = body not in moving
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, data.geom_xmat[geom])
    material = int(model.geom_matid[geom])
    return {
        "shape": SHAPES[kind],
        "size": _rounded(model.geom_size[geom]),
        "body": -1 if still else moving.index(body),
        "pos": _rounded(data.geom_xpos[geom] if still else model.geom_pos[geom]),
        "quat": _rounded(quat if still else model.geom_quat[geom]),
        "rgba": _rounded(_colour(model, geom)),
        "specular": 0.2 if material < 0 else round(float(model.mat_specular[material]), 3),
        "shininess": 0.3 if material < 0 else round(float(model.mat_shininess[material]), 3),
    }


def _colour(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """A geom's colour: its own, unless that is MuJoCo's default and it has a material."""
    material = int(model.geom_matid[geom])
    own = model.geom_rgba[geom]
    plain = material >= 0 and np.allclose(own, (0.5, 0.5, 0.5, 1))
    return model.mat_rgba[material] if plain else own


def _rounded(values: np.ndarray) -> list[float]:
    return [round(float(value), 6) for value in values]
