"""What a piece of furniture must be to be one: values in their bounds, names, connectors that fit, steps that build on.

Every check raises a `FurnitureError` that names the field as a furniture file does.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tstar_envs.furniture.errors import FurnitureError
from tstar_envs.furniture.rules import (
    check_choice,
    check_lengths,
    check_names,
    check_number,
    check_sizes,
    check_unit,
)
from tstar_envs.furniture.shapes import Box, Shape

if TYPE_CHECKING:  # it imports this module
    from tstar_envs.furniture.schema import Furniture, Part, Step

MAX_DENSITY = 20_000.0
"""kg / m^3; gold weighs 19,300."""
LEAST_TRAVEL = 0.06
"""m: the least height over a grasp point at which the hand comes there, and that of a step which does not say."""
GRASP_FROM = ("above", "back")
APPROACHES = ("above", "axis")


def check_furniture(furniture: Furniture) -> None:
    """Raises FurnitureError for the first thing that cannot be."""
    check_names("name", (furniture.name,))
    for what, found in (("parts", furniture.parts), ("steps", furniture.steps)):
        if not found:
            raise FurnitureError(f"{what}: got none, a piece of furniture needs at least one")
    check_number("z_finedist", furniture.z_finedist, positive=True, most=1.0)
    check_names("parts", furniture.part_names)
    for part in furniture.parts:
        _check_part(part, f"parts.{part.name}")
    for i, step in enumerate(furniture.steps):
        _check_values(step, f"steps[{i}]")
        _check_step(furniture, step, f"steps[{i}]")
    joined_pieces(furniture)
    _check_connectors_once(furniture)
    for field in ("contact_impedance", "weld_impedance"):
        value = getattr(furniture, field)
        if value is None:
            continue
        check_number(field, value)
        if not 0 < value < 1:
            raise FurnitureError(f"{field}: got {value:g}, expected a number between 0 and 1")
    for i, pair in enumerate(furniture.no_contact):
        _check_pair(furniture, pair, f"no_contact[{i}]")


def _check_pair(furniture: Furniture, pair: tuple[str, str], where: str) -> None:
    if len(pair) != 2 or pair[0] == pair[1]:
        raise FurnitureError(f"{where}: got {list(pair)}, expected two different parts")
    for name in pair:
        try:
            furniture.part(name)
        except FurnitureError as error:
            raise FurnitureError(f"{where}: {error}") from None


def _check_part(part: Part, where: str) -> None:
    check_lengths(f"{where}.initial_pose", part.initial_pose[:3])
    check_unit(f"{where}.initial_pose", part.initial_pose[3:], size=4)
    check_number(f"{where}.density", part.density, positive=True, most=MAX_DENSITY)
    if not part.shapes:
        raise FurnitureError(f"{where}.boxes: got none, a part needs a box, a cylinder or a capsule")
    for kind in ("boxes", "cylinders", "capsules"):
        for i, shape in enumerate(getattr(part, kind)):
            _check_shape(shape, f"{where}.{kind}[{i}]")
    check_names(f"{where}.connectors", (connector.name for connector in part.connectors))
    for connector in part.connectors:
        at = f"{where}.connectors.{connector.name}"
        check_lengths(f"{at}.pos", connector.pos)
        check_unit(f"{at}.quat", connector.quat, size=4)
        for field in ("kind", "mates_with"):
            if not isinstance(value := getattr(connector, field), str) or not value:
                raise FurnitureError(f"{at}.{field}: got {value!r}, expected a name")
        if not isinstance(connector.allowed_angles, tuple):
            raise FurnitureError(
                f"{at}.allowed_degrees: got {connector.allowed_angles!r}, expected a tuple, rad"
            )
        for angle in connector.allowed_angles:
            check_number(f"{at}.allowed_degrees", angle)
        if connector.part != part.name:
            raise FurnitureError(f"{at}: is said to be of {connector.part!r}, expected {part.name!r}")
    for i, grasp in enumerate(part.grasps):
        check_lengths(f"{where}.grasps[{i}]", grasp.point)
        check_unit(f"{where}.grasps[{i}]", grasp.axis)


def _check_shape(shape: Shape, where: str) -> None:
    if isinstance(shape, Box):
        check_sizes(f"{where}.size", shape.size, 3)
    else:
        check_sizes(f"{where}.radius", (shape.radius,))
        check_sizes(f"{where}.half_length", (shape.half_length,))
    check_lengths(f"{where}.pos", shape.pos)
    check_unit(f"{where}.quat", shape.quat, size=4)


def _check_values(step: Step, where: str) -> None:
    check_number(f"{where}.degrees", step.angle)
    check_lengths(f"{where}.waypoint", step.waypoint)
    check_unit(f"{where}.grip_angle", step.grip_angle)
    check_choice(f"{where}.grasp_from", step.grasp_from, GRASP_FROM)
    check_choice(f"{where}.approach", step.approach, APPROACHES)
    check_number(f"{where}.travel_height", step.travel_height, least=LEAST_TRAVEL, most=0.5)
    check_number(f"{where}.turn_height", step.turn_height, least=0.0, most=1.0)
    check_number(f"{where}.insertion", step.insertion, least=0.0, most=0.5)
    check_number(f"{where}.clearance", step.clearance, positive=True, most=0.1)


def joined_pieces(furniture: Furniture) -> list[tuple[str, ...]]:
    """The pieces that the steps leave, each the names of its parts: a single one if everything is joined.

    Raises:
        FurnitureError: a step joins two parts which the steps before made one piece.
    """
    piece = {name: (name,) for name in furniture.part_names}
    for i, step in enumerate(furniture.steps):
        if step.target_part in piece[step.moving_part]:
            raise FurnitureError(
                f"steps[{i}]: {step.moving_part} and {step.target_part} are one piece by then, "
                "joined by the steps before"
            )
        joined = piece[step.target_part] + piece[step.moving_part]
        piece |= dict.fromkeys(joined, joined)
    return list(dict.fromkeys(piece.values()))


def _check_connectors_once(furniture: Furniture) -> None:
    used: dict[tuple[str, str], int] = {}
    for i, step in enumerate(furniture.steps):
        for side in ("moving", "target"):
            name = getattr(step, f"{side}_part"), getattr(step, f"{side}_connector")
            if name in used:
                raise FurnitureError(
                    f"steps[{i}].{side}_connector: {'.'.join(name)} is joined already, by steps[{used[name]}]"
                )
            used[name] = i


def _check_step(furniture: Furniture, step: Step, where: str) -> None:
    try:
        moving = furniture.part(step.moving_part).connector(step.moving_connector)
        target = furniture.part(step.target_part).connector(step.target_connector)
    except FurnitureError as error:
        raise FurnitureError(f"{where}: {error}") from None
    if moving.mates_with != target.kind or target.mates_with != moving.kind:
        raise FurnitureError(
            f"{where}: connector {moving.part}.{moving.name} ({moving.kind!r}, mates with {moving.mates_with!r}) "
            f"cannot join {target.part}.{target.name} ({target.kind!r}, mates with {target.mates_with!r})"
        )
    if moving.part == target.part:
        raise FurnitureError(f"{where}: joins part {moving.part!r} to itself, expected two parts")
    if not moving.turns_freely and not any(
        abs(math.remainder(step.angle - angle, math.tau)) < 1e-6 for angle in moving.allowed_angles
    ):
        allowed = ", ".join(f"{math.degrees(angle):g}" for angle in moving.allowed_angles)
        raise FurnitureError(
            f"{where}.degrees: got {math.degrees(step.angle):g} degrees, "
            f"connector {moving.part}.{moving.name} allows {allowed}"
        )
    grasps = len(furniture.part(step.moving_part).grasps)
    if not grasps:
        raise FurnitureError(
            f"parts.{step.moving_part}.grasps: got none, {where} moves the part and needs one"
        )
    if type(step.grasp_index) is not int or not 0 <= step.grasp_index < grasps:
        raise FurnitureError(
            f"{where}.grasp: got {step.grasp_index!r}, valid: 0 to {grasps - 1}, the grasps of {step.moving_part}"
        )
