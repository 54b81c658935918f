"""How the Sawyer arm is drawn: rounded links, dark joints, a head, and a pedestal that stands on the floor.

Nothing here collides or weighs anything. Still it is left out of the scene that is simulated, because MuJoCo moves
every geom in every step: these would cost 5% of the speed. `tstar_envs.look` adds it to a scene to draw.

Sizes in m, positions in the frame of the link. Source: by eye, about the axes of the joints.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco

from tstar_envs.robots import sawyer

SIMULATED_GROUP = 3
"""Geom group of the simulated arm's own geoms in a scene to draw: MuJoCo's viewers hide it until key 3 is pressed."""

DRAWN_ONLY_GROUP = 1

Point = tuple[float, float, float]


class Material(NamedTuple):
    """Colour, and how it shines."""

    rgba: tuple[float, float, float, float]
    specular: float
    shininess: float


MATERIALS = {
    "shell": Material((0.66, 0.09, 0.1, 1), 0.5, 0.6),
    "joint": Material((0.16, 0.17, 0.19, 1), 0.4, 0.5),
    "trim": Material((0.62, 0.64, 0.67, 1), 0.6, 0.7),
    "steel": Material((0.26, 0.27, 0.3, 1), 0.3, 0.4),
    "screen": Material((0.05, 0.07, 0.1, 1), 0.9, 0.9),
    "eye": Material((0.55, 0.85, 0.95, 1), 0.2, 0.2),
}


class Shape(NamedTuple):
    """A capsule or a cylinder from one point to another, or an ellipsoid about `start` with half-axes `end`."""

    kind: str
    body: str
    start: Point
    end: Point
    radius: float
    material: str


def _capsule(body: str, start: Point, end: Point, radius: float, material: str = "shell") -> Shape:
    return Shape("capsule", body, start, end, radius, material)


def _cylinder(body: str, start: Point, end: Point, radius: float, material: str = "joint") -> Shape:
    return Shape("cylinder", body, start, end, radius, material)


def _ellipsoid(body: str, centre: Point, half_axes: Point, material: str) -> Shape:
    return Shape("ellipsoid", body, centre, half_axes, 0.0, material)


_FLOOR = -sawyer.BASE_POS[2]
"""Height of the floor in the frame of the base."""

PEDESTAL = (
    _cylinder("base", (0, 0, _FLOOR), (0, 0, _FLOOR + 0.02), 0.2),
    _cylinder("base", (0, 0, _FLOOR + 0.02), (0, 0, _FLOOR + 0.026), 0.185, "trim"),
    _cylinder("base", (0, 0, _FLOOR + 0.026), (0, 0, -0.02), 0.1, "joint"),
    _cylinder("base", (0, 0, -0.02), (0, 0, 0), 0.13, "trim"),
    _cylinder("base", (0, 0, 0), (0, 0, 0.075), 0.11, "joint"),
)

LINKS = (
    # Turret and shoulder; the shoulder's axis is y.
    _cylinder("right_l0", (0, 0, -0.005), (0, 0, 0.1), 0.095, "shell"),
    _capsule("right_l0", (0, 0, 0.1), (0, 0, 0.237), 0.092),
    _capsule("right_l0", (0, 0, 0.237), (0.081, 0, 0.237), 0.078),
    _cylinder("right_l0", (0.081, -0.062, 0.237), (0.081, 0.044, 0.237), 0.072),
    # Upper arm: beside the shoulder, then along -y.
    _cylinder("right_l1", (0, 0, -0.008), (0, 0, 0.03), 0.07, "trim"),
    _capsule("right_l1", (0, 0, 0.07), (0, 0, 0.1425), 0.072),
    _capsule("right_l1", (0, 0, 0.1425), (0, -0.085, 0.1425), 0.066),
    _cylinder("right_l1", (0, -0.09, 0.1425), (0, -0.165, 0.1425), 0.062),
    _cylinder("right_l2", (0, 0, 0.022), (0, 0, 0.034), 0.0635, "trim"),
    _capsule("right_l2", (0, 0, 0.07), (0, 0, 0.2), 0.062),
    _capsule("right_l2", (0, 0, 0.2), (0, 0, 0.26), 0.058),
    _cylinder("right_l2", (0, 0.066, 0.26), (0, -0.05, 0.26), 0.052),
    # Elbow: beside the upper arm, then along -y.
    _cylinder("right_l3", (0, 0, 0.006), (0, 0, -0.02), 0.053, "trim"),
    _capsule("right_l3", (0, 0, -0.06), (0, 0, -0.1265), 0.056),
    _capsule("right_l3", (0, 0, -0.1265), (0, -0.07, -0.1265), 0.052),
    _cylinder("right_l3", (0, -0.075, -0.1265), (0, -0.14, -0.1265), 0.048),
    # Forearm.
    _cylinder("right_l4", (0, 0, 0.014), (0, 0, 0.024), 0.0495, "trim"),
    _capsule("right_l4", (0, 0, 0.055), (0, 0, 0.2), 0.048),
    _capsule("right_l4", (0, 0, 0.2), (0, 0, 0.275), 0.046),
    _cylinder("right_l4", (0, -0.05, 0.275), (0, 0.034, 0.275), 0.043),
    # Wrist: beside the forearm, then along -y to the flange.
    _cylinder("right_l5", (0, 0, 0.003), (0, 0, 0.02), 0.044, "trim"),
    _capsule("right_l5", (0, 0, 0.05), (0, 0, 0.1053), 0.048),
    _capsule("right_l5", (0, 0, 0.1053), (0, -0.05, 0.1053), 0.046),
    _cylinder("right_l5", (0, -0.05, 0.1053), (0, -0.1, 0.1053), 0.043),
    _cylinder("right_l6", (0, 0, -0.01), (0, 0, -0.001), 0.045, "trim"),
    _cylinder("right_l6", (0, 0, -0.001), (0, 0, 0.03), 0.04),
)

HEAD = (
    _cylinder("right_l0", (-0.01, 0, 0.3), (-0.01, 0, 0.36), 0.03),
    _ellipsoid("right_l0", (0.01, 0, 0.43), (0.032, 0.135, 0.088), "joint"),
    _ellipsoid("right_l0", (0.022, 0, 0.43), (0.026, 0.12, 0.074), "screen"),
    _ellipsoid("right_l0", (0.042, 0.042, 0.437), (0.008, 0.022, 0.022), "eye"),
    _ellipsoid("right_l0", (0.042, -0.042, 0.437), (0.008, 0.022, 0.022), "eye"),
)

HAND = (
    _capsule("hand", (0, -0.03, -0.004), (0, 0.03, -0.004), 0.026, "steel"),
    _cylinder("hand", (0, 0, -0.024), (0, 0, -0.012), 0.036, "trim"),
)


def add_look(spec: mujoco.MjSpec) -> None:
    """Draws the arm of a scene from `sawyer.add_sawyer`: adds what is seen, and hides the stand-ins that collide."""
    for link in ("base", *(link.name for link in sawyer.LINKS)):
        for geom in spec.body(link).geoms:
            geom.group = SIMULATED_GROUP
    for name, material in MATERIALS.items():
        spec.add_material(
            name=name, rgba=material.rgba, specular=material.specular, shininess=material.shininess
        )
    for shape in (*PEDESTAL, *LINKS, *HEAD, *HAND):
        _add(spec, shape)


def _add(spec: mujoco.MjSpec, shape: Shape) -> None:
    drawn = {"contype": 0, "conaffinity": 0, "group": DRAWN_ONLY_GROUP, "mass": 0, "material": shape.material}
    body = spec.body(shape.body)
    if shape.kind == "ellipsoid":
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_ELLIPSOID, pos=shape.start, size=shape.end, **drawn)
        return
    kind = mujoco.mjtGeom.mjGEOM_CAPSULE if shape.kind == "capsule" else mujoco.mjtGeom.mjGEOM_CYLINDER
    body.add_geom(type=kind, fromto=(*shape.start, *shape.end), size=(shape.radius, 0, 0), **drawn)
