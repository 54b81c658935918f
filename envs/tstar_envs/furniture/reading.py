"""Reads a file of furniture; an error names the file, the field, what was got and what is valid."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import yaml

from tstar_envs.checks import short
from tstar_envs.furniture.errors import FurnitureError
from tstar_envs.furniture.fields import Fields, refuse_odd_names
from tstar_envs.furniture.schema import (
    ANY_TURN,
    DOWN,
    Connector,
    Furniture,
    Grasp,
    Part,
    Step,
)
from tstar_envs.furniture.shapes import Box, Capsule, Cylinder


def read_file(path: Path) -> tuple[Furniture, Any]:
    """Reads and checks one furniture file; returns the piece, and what its file says as plain values.

    Raises:
        FurnitureError: it is no YAML in UTF-8, or says something that cannot be.
        OSError: it cannot be read.
    """
    try:
        text = path.read_bytes().decode()
        refuse_odd_names(yaml.compose(text, yaml.SafeLoader), "")
        said = yaml.safe_load(text)
        return _furniture(Fields(said, ""), path.stem), said
    except UnicodeDecodeError as error:
        raise FurnitureError(f"{path.name}: is not text in UTF-8: {error}") from None
    except RecursionError:
        raise FurnitureError(f"{path.name}: lists or mappings are nested too deeply to be read") from None
    # YAML's reader gives up on some numbers and dates with a ValueError.
    except (ValueError, yaml.YAMLError) as error:
        raise FurnitureError(f"{path.name}: {error}") from None


def _furniture(fields: Fields, name: str) -> Furniture:
    parts = tuple(_part(part, child) for part, child in fields.children("parts"))
    steps = tuple(_step(child) for child in fields.items("steps"))
    z_finedist = fields.number("z_finedist")
    pairs = fields.name_lists("no_contact")
    stiff = [
        None if fields.get(key, None) is None else fields.number(key)
        for key in ("contact_impedance", "weld_impedance")
    ]
    fields.finish()
    return Furniture(name, parts, steps, z_finedist, pairs, *stiff)


def _part(name: str, fields: Fields) -> Part:
    part = Part(
        name=name,
        initial_pose=fields.pose("initial_pose"),
        boxes=tuple(_box(child) for child in fields.items("boxes", [])),
        density=fields.number("density"),
        connectors=tuple(_connector(key, name, child) for key, child in fields.children("connectors", {})),
        grasps=tuple(_grasp(child) for child in fields.items("grasps", [])),
        cylinders=tuple(_round(child, Cylinder) for child in fields.items("cylinders", [])),
        capsules=tuple(_round(child, Capsule) for child in fields.items("capsules", [])),
    )
    fields.finish()
    return part


def _box(fields: Fields) -> Box:
    box = Box(
        fields.numbers("size", 3), fields.numbers("pos", 3, default=(0.0, 0.0, 0.0)), fields.quat("quat")
    )
    fields.finish()
    return box


def _round(fields: Fields, kind: type[Cylinder]) -> Cylinder:
    radius, half_length = fields.number("radius"), fields.number("half_length")
    shape = kind(radius, half_length, fields.numbers("pos", 3, default=(0.0, 0.0, 0.0)), fields.quat("quat"))
    fields.finish()
    return shape


def _connector(name: str, part: str, fields: Fields) -> Connector:
    connector = Connector(
        name,
        part,
        fields.numbers("pos", 3),
        fields.text("kind"),
        fields.text("mates_with"),
        fields.quat("quat"),
        _turns(fields),
    )
    fields.finish()
    return connector


def _turns(fields: Fields) -> tuple[float, ...]:
    """The allowed turns about the up axis, rad; the word `any` where a round part fits however it is turned."""
    value = fields.get("allowed_degrees", None)
    if value == "any":
        return ANY_TURN
    if isinstance(value, str):
        where = fields.at("allowed_degrees")
        raise FurnitureError(f"{where}: got {short(value)}, expected a list of numbers, or the word any")
    return tuple(math.radians(x) for x in fields.numbers("allowed_degrees", None, default=(0.0,)))


def _grasp(fields: Fields) -> Grasp:
    """The two finger targets become the point between them and the axis from the left to the right one."""
    left, right = fields.lengths("left", 3), fields.lengths("right", 3)
    fields.finish()
    length = math.dist(left, right)
    if length < 1e-6:
        raise FurnitureError(f"{fields.where}: left and right are both {list(left)}, expected two points")
    point = tuple((a + b) / 2 for a, b in zip(left, right, strict=True))
    axis = tuple((b - a) / length for a, b in zip(left, right, strict=True))
    return Grasp(point, axis)  # pyright: ignore[reportArgumentType]


def _step(fields: Fields) -> Step:
    step = Step(
        moving_part=fields.text("moving_part"),
        target_part=fields.text("target_part"),
        moving_connector=fields.text("moving_connector"),
        target_connector=fields.text("target_connector"),
        angle=math.radians(fields.number("degrees")),
        waypoint=fields.numbers("waypoint", 3),
        grasp_index=fields.index("grasp", 0),
        grip_angle=fields.direction("grip_angle", DOWN),
        grasp_from=fields.get("grasp_from", Step.grasp_from),
        travel_height=fields.number("travel_height", Step.travel_height),
        turn_height=fields.number("turn_height", Step.turn_height),
        approach=fields.get("approach", Step.approach),
        insertion=fields.number("insertion", Step.insertion),
        clearance=fields.number("clearance", Step.clearance),
    )
    fields.finish()
    return step
