"""Checks of how a part is taken: what the fingers find there, and whether the arm reaches where it must."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import torch

from tstar_envs import geometry
from tstar_envs.inspection.finding import Finding, doubtful, wrong
from tstar_envs.inspection.reach import shortfall
from tstar_envs.inspection.workshop import FAR, Workshop

WIDEST, NARROWEST, FIRM = 0.079, 0.0145, 0.0175
"""m: between the pads open and closed, and what they hold firmly: docs/decisions/0007-chair.md."""
SLIPS = 0.005
"""m: an open finger over no more of a part than that slips down beside it. The script took table_lack's first leg with
2.5 mm of it under a finger in 4 of 4 episodes, with 5.5 mm in 3, with 15.5 mm in none."""


def grasp_findings(workshop: Workshop, k: int) -> Iterator[Finding]:
    """Everything about the grasp of step `k`."""
    yield from _grasp(workshop, k)
    yield from _reach(workshop, k)


def _grasp(workshop: Workshop, k: int) -> Iterator[Finding]:
    workshop.place(workshop.nominal[k])
    step, where = workshop.furniture.steps[k], f"steps[{k}].grasp"
    point, axis = _grasp_in_world(workshop, k)
    surfaces = workshop.thickness(workshop.group(k), point, axis)
    if surfaces is None:
        yield wrong(
            where,
            f"nothing of {step.moving_part} is between the fingers there, or it is wider than {2000 * FAR:.0f} mm",
        )
        return
    width = sum(surfaces)
    if width > WIDEST or width < NARROWEST:
        yield wrong(
            where,
            f"{step.moving_part} is {1000 * width:.0f} mm wide there, the fingers take "
            f"{1000 * NARROWEST:.1f} to {1000 * WIDEST:.0f} mm",
        )
    elif width < FIRM:
        yield doubtful(
            where,
            f"{step.moving_part} is {1000 * width:.0f} mm wide there: below {1000 * FIRM:.0f} mm the pads "
            f"hardly press",
        )
    if abs(surfaces[0] - surfaces[1]) > 0.01:
        yield _aside(step.moving_part, where, surfaces)
    tilt = abs(float(axis @ np.array(step.grip_angle)))
    if tilt > 0.5:
        yield wrong(
            where, "the fingers would close along the direction in which the hand comes: turn one of the two"
        )


def _aside(part: str, where: str, surfaces: tuple[float, float]) -> Finding:
    """What a grasp beside the middle of a part does; `surfaces` as in `Workshop.thickness`."""
    off, half = 500 * abs(surfaces[0] - surfaces[1]), WIDEST / 2
    if -min(surfaces) > half:
        return wrong(
            where, f"nothing of {part} is between the fingers there: it is {off:.0f} mm beside their middle"
        )
    if max(surfaces) > half + SLIPS:
        return wrong(where, f"a finger comes down on {part}, whose middle is {off:.0f} mm off the grasp's")
    return doubtful(
        where, f"its middle is {off:.0f} mm off the middle of the part: one finger pushes it first"
    )


def _reach(workshop: Workshop, k: int) -> Iterator[Finding]:
    """The hand where it grasps, and where it holds the part when the connectors meet: one way round, the easier.

    And at the lift point, which the reward asks for and the script need not come by.
    """
    step = workshop.furniture.steps[k]
    point, axis = _grasp_in_world(workshop, k)
    approach = np.array(step.grip_angle)
    axis = axis - approach * (axis @ approach)
    if np.linalg.norm(axis) < 0.1:
        return
    axis /= np.linalg.norm(axis)
    moved = _motion(workshop, k)
    sides = []
    for side in (1.0, -1.0):
        hand = np.stack([np.cross(side * axis, approach), side * axis, approach], axis=1)
        ends = (point, hand), (moved[:3, :3] @ point + moved[:3, 3], moved[:3, :3] @ hand)
        sides.append(([shortfall(workshop.model, tip, frame) for tip, frame in ends], hand))
    easier, hand = min(sides, key=lambda side: max(each.distance + 0.1 * each.angle for each in side[0]))
    yield from _lift(workshop, k, point, hand)
    for found, what in zip(easier, ("to grasp", "to join"), strict=True):
        if not found.reached:
            off, angle = 1000 * found.distance, np.degrees(found.angle)
            yield wrong(
                f"steps[{k}]",
                f"{what} {step.moving_part} the hand must be where the arm does not reach: it stays {off:.0f} mm and "
                f"{angle:.0f} degrees off. Move the parts nearer to the robot's middle, or turn them",
            )


def _lift(workshop: Workshop, k: int, point: np.ndarray, hand: np.ndarray) -> Iterator[Finding]:
    """The hand at the lift point, turned as it grasps at `point`."""
    step, where = workshop.furniture.steps[k], f"steps[{k}].waypoint"
    if step.waypoint[2] < 0:
        yield doubtful(where, f"the reward asks the hand to lift {step.moving_part} to below where it lay")
        return
    found = shortfall(workshop.model, point + np.array(step.waypoint), hand)
    if not found.reached:
        yield doubtful(
            where,
            f"to lift {step.moving_part} there the hand must be where the arm does not reach: it stays "
            f"{1000 * found.distance:.0f} mm and {np.degrees(found.angle):.0f} degrees off",
        )


def _grasp_in_world(workshop: Workshop, k: int) -> tuple[np.ndarray, np.ndarray]:
    step, grasp = workshop.furniture.steps[k], workshop.furniture.grasp_of(k)
    pose = workshop.nominal[k][workshop.furniture.part_index(step.moving_part)]
    frame = _matrix(pose)
    return frame[:3, :3] @ np.array(grasp.point) + frame[:3, 3], frame[:3, :3] @ np.array(grasp.axis)


def _motion(workshop: Workshop, k: int) -> np.ndarray:
    """The motion (4, 4) that takes the moving part from where it lies to where it is joined."""
    part = workshop.furniture.part_index(workshop.furniture.steps[k].moving_part)
    return _matrix(workshop.nominal[k + 1][part]) @ np.linalg.inv(_matrix(workshop.nominal[k][part]))


def _matrix(pose: np.ndarray) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = geometry.quat_to_matrix(torch.as_tensor(pose[3:])).numpy()
    matrix[:3, 3] = pose[:3]
    return matrix
