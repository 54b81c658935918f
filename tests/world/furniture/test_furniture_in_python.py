"""What a piece that is built in Python is told that is wrong: the same as a file."""

from dataclasses import replace

import numpy as np
import pytest

from tstar_envs import furniture
from tstar_envs.furniture import FurnitureError
from tstar_envs.furniture.shapes import Box


def changed_step(chair, **values):
    return replace(chair, steps=(replace(chair.steps[0], **values),))


def changed_part(chair, **values):
    return replace(chair, parts=(replace(chair.parts[0], **values), *chair.parts[1:]))


def changed_connector(chair, **values):
    first, *others = chair.parts[0].connectors
    return changed_part(chair, connectors=(replace(first, **values), *others))


def test_a_connector_is_joined_once():
    table = furniture.load("table_lack")
    first, second, *others = table.steps
    copied = replace(second, target_connector=first.target_connector)  # copied, and not changed
    name = f"{first.target_part}.{first.target_connector}"
    with pytest.raises(
        FurnitureError, match=rf"steps\[1\].target_connector: {name} is joined already, by steps\[0\]"
    ):
        replace(table, steps=(first, copied, *others))


@pytest.mark.parametrize(
    "change, message",
    [
        (
            lambda c: replace(c, parts=(*c.parts, c.parts[0])),
            "parts: two are called 'seat', expected each name once",
        ),
        (lambda c: changed_part(c, name=""), "parts: got '', expected a name"),
        (lambda c: replace(c, z_finedist=-1), "z_finedist: got -1, expected a positive number"),
        (lambda c: replace(c, name=3), "name: got 3, expected a name"),
        (lambda c: changed_part(c, boxes=(Box((0.1, 0.1)),)), r"seat.boxes\[0\].size: got "),
        (lambda c: changed_part(c, boxes=(Box((0.1,) * 4),)), r"seat.boxes\[0\].size: got "),
        (lambda c: changed_part(c, boxes=(Box(0.1),)), r"seat.boxes\[0\].size: got "),
        (lambda c: changed_connector(c, kind=None), r"seat\.connectors\..*\.kind: got None, expected a name"),
        (lambda c: changed_connector(c, mates_with=3), r"\.mates_with: got 3, expected a name"),
        (
            lambda c: changed_connector(c, allowed_angles=[0.0]),
            r"allowed_degrees: got \[0.0\], expected a tuple",
        ),
        (lambda c: replace(c, name=""), "name: got '', expected a name"),
        (lambda c: replace(c, weld_impedance="a"), "weld_impedance: got 'a', expected a finite number"),
        (
            lambda c: changed_part(c, initial_pose=(0.0, 0.0, 0.0, 1.0, 0.0, 0.0)),
            "initial_pose: got .*, expected 4 numbers",
        ),
        (
            lambda c: changed_step(c, waypoint=(0, 0)),
            r"steps\[0\].waypoint: got \(0, 0\), expected 3 numbers",
        ),
        (
            lambda c: changed_step(c, grasp_index=0.0),
            r"steps\[0\].grasp: got 0.0, valid: 0 to 1, the grasps of side",
        ),
        (
            lambda c: changed_step(c, grip_angle=(0, 0, -3)),
            r"steps\[0\].grip_angle: got \[0, 0, -3\] of length 3",
        ),
        (
            lambda c: changed_step(c, grasp_from="side"),
            r"steps\[0\].grasp_from: got 'side', valid: 'above', 'back'",
        ),
        (lambda c: changed_step(c, moving_part=3), "no part of 'chair' is called 3"),
        (lambda c: replace(c, no_contact=((1, 2),)), "no_contact"),
        (
            lambda c: changed_step(c, clearance=float("inf")),
            r"steps\[0\].clearance: got inf, expected a finite",
        ),
        (
            lambda c: changed_part(c, density=float("nan")),
            "parts.seat.density: got nan, expected a finite number",
        ),
        (lambda c: changed_part(c, boxes=()), "parts.seat.boxes: got none, a part needs a box"),
        (
            lambda c: changed_part(c, connectors=2 * c.parts[0].connectors),
            "parts.seat.connectors: two are called 'left'",
        ),
        (
            lambda c: changed_part(c, initial_pose=(0, 0, 0, 2, 0, 0, 0)),
            r"parts.seat.initial_pose: got \[2, 0, 0, 0\] of length 2",
        ),
        (lambda c: replace(c, steps=2 * c.steps), r"steps\[1\]: side and seat are one piece by then"),
        (
            lambda c: changed_connector(c, allowed_angles=(0.0, float("nan"))),
            r"parts.seat.connectors.left.allowed_degrees: got nan, expected a finite number",
        ),
        (lambda c: changed_connector(c, part="side"), r"left: is said to be of 'side', expected 'seat'"),
    ],
)
def test_a_piece_built_in_python_is_checked_as_a_file_is(chair, change, message):
    with pytest.raises(FurnitureError, match=message):
        change(chair())


def test_numbers_of_numpy_are_numbers(chair):
    piece = chair()
    assert changed_part(piece, density=np.int64(100)).parts[0].density == 100
    assert changed_step(piece, clearance=np.float32(0.01)).steps[0].clearance == np.float32(0.01)
