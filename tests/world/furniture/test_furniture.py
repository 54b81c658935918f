"""Furniture files: what they say, and what they are told when they are wrong."""

import dataclasses
import math

import mujoco
import pytest
import torch
import yaml

from tstar_envs import furniture, geometry
from tstar_envs.connection import align
from tstar_envs.furniture import FurnitureError
from tstar_envs.furniture.library import DATA, read
from tstar_envs.scene import build_model

CHAIR = """
z_finedist: 0.1
parts:
  seat:
    initial_pose: [-0.25, 0.107139, 0.002981, 0, 0, -1, -3.8e-05]
    density: 50
    boxes:
      - size: [0.123, 0.113, 0.003]
        pos: [0, -0.012601, 0]
      - size: [0.09, 0.012, 0.003]
        pos: [0, 0.115, 0]
        quat: [0.998174, -0.060412, 0, 0]
    connectors:
      left: {pos: [-0.105, 0.003175, -0.004], kind: seat-side, mates_with: side-seat, allowed_degrees: [0, 180]}
  side:
    initial_pose: [-0.05, 0.094433, 0.015668, 0, 1, 0, 0]
    density: 50
    boxes: [{size: [0.008, 0.098, 0.015786]}]
    connectors:
      seat: {pos: [0, 0, 0.01505], kind: side-seat, mates_with: seat-side, allowed_degrees: [0, 180]}
      front: {pos: [0, 0.096549, 0], quat: [0.707107, 0.707107, 0, 0], kind: side-front, mates_with: front-side}
    grasps:
      - {left: [0.02, 0, -0.01], right: [-0.02, 0, -0.01]}
      - {left: [0.02, 0.06, -0.01], right: [-0.02, 0.06, -0.01]}
steps:
  - {moving_part: side, target_part: seat, moving_connector: seat, target_connector: left, degrees: 180,
     waypoint: [0, 0, 0.05], grasp: 1}
"""


@pytest.fixture
def chair(tmp_path):
    """Returns a function that changes the chair's file and reads it."""

    def read_changed(change=lambda data: None):
        data = yaml.safe_load(CHAIR)
        change(data)
        path = tmp_path / "chair.yaml"
        path.write_text(yaml.safe_dump(data, sort_keys=False))
        return read(path)

    return read_changed


def test_table_lack_is_the_reference_task():
    table = furniture.load("table_lack")
    assert table.part_names == ("leg_1", "leg_2", "leg_3", "leg_4", "table_top")
    assert [step.moving_part for step in table.steps] == ["leg_2", "leg_3", "leg_4", "leg_1"]
    assert [step.target_connector for step in table.steps] == ["corner_2", "corner_1", "corner_4", "corner_3"]
    assert {step.target_part for step in table.steps} == {"table_top"}
    assert table.z_finedist == 0.05
    assert table.part("leg_1").boxes[0].size == (0.015, 0.015, 0.13125)
    assert (table.part("leg_3").density, table.part("table_top").density) == (100, 300)
    assert table.part_index("table_top") == 4


def test_table_lack_connectors_and_grasps():
    table = furniture.load("table_lack")
    moving, target = table.connectors_of(1)
    assert (moving.part, moving.pos, target.pos) == ("leg_3", (0, 0, 0.13125), (-0.305, -0.095, -0.02))
    assert moving.allowed_angles == pytest.approx((0, math.pi / 2, math.pi, 3 * math.pi / 2))
    # The turns that our robot makes: docs/decisions/0006-turns.md.
    assert [step.angle for step in table.steps] == pytest.approx([math.pi, math.pi, 0, 0])
    assert [table.grasp_of(i).axis for i in range(4)] == [(1, 0, 0), (-1, 0, 0), (1, 0, 0), (1, 0, 0)]


def test_chair_ingolf_is_the_reference_task():
    chair = furniture.load("chair_ingolf")
    assert chair.part_names == ("front", "left_side", "right_side", "seat", "back")
    joined = [(s.moving_part, s.target_part, round(math.degrees(s.angle))) for s in chair.steps]
    assert joined == [
        ("right_side", "seat", 180), ("left_side", "seat", 180), ("left_side", "back", 0), ("front", "left_side", 0)
    ]  # fmt: skip
    assert [step.waypoint[2] for step in chair.steps] == [0.05, 0.05, 0.1, 0.27]
    moving, target = chair.connectors_of(2)
    assert (moving.pos, target.pos) == ((0.003656, -0.101451, 0.00105), (0.1035, -0.036463, -0.047477))
    assert chair.z_finedist == 0.1
    assert [len(part.boxes) for part in chair.parts] == [3, 1, 1, 2, 11]


def test_a_chair_fits_the_same_schema(chair):
    piece = chair()
    assert piece.name == "chair" and piece.z_finedist == 0.1
    assert piece.part("side").connector("front").allowed_angles == (0,)
    assert piece.grasp_of(0).point == pytest.approx((0, 0.06, -0.01))


def test_cylinders_and_capsules_stand_beside_boxes(chair):
    capsule = {"radius": 0.01, "half_length": 0.05, "pos": [0, 0, 0.1], "quat": [0, 1, 0, 0]}
    round_shapes = {"cylinders": [{"radius": 0.02, "half_length": 0.1}], "capsules": [capsule]}
    part = chair(lambda d: d["parts"]["side"].update(round_shapes)).part("side")
    assert [type(shape).__name__ for shape in part.shapes] == ["Box", "Cylinder", "Capsule"]
    assert [shape.size for shape in part.shapes[1:]] == [(0.02, 0.1, 0), (0.01, 0.05, 0)]
    assert part.shapes[2].pos == (0, 0, 0.1)


def test_a_part_may_be_a_cylinder_alone(chair):
    def make_round(data):
        del data["parts"]["seat"]["boxes"]
        data["parts"]["seat"]["cylinders"] = [{"radius": 0.1, "half_length": 0.003}]

    model = build_model(chair(make_round))
    geom = model.geom(model.body("seat").geomadr[0])
    assert geom.type == mujoco.mjtGeom.mjGEOM_CYLINDER and geom.size[:2] == pytest.approx([0.1, 0.003])
    assert model.body("seat").mass[0] == pytest.approx(50 * math.pi * 0.1**2 * 0.006)


def test_a_round_connector_fits_at_any_turn(chair):
    piece = chair(lambda d: _set(d, "parts", "side", "connectors", "seat", "allowed_degrees", "any"))
    connector = piece.part("side").connector("seat")
    assert connector.turns_freely and not piece.part("seat").connector("left").turns_freely
    angles = torch.tensor([connector.allowed_angles], dtype=torch.float64)
    still, turned = (
        torch.eye(3, dtype=torch.float64)[None],
        geometry.yaw_quat(torch.tensor([0.7], dtype=torch.float64)),
    )
    point = torch.zeros(1, 3, dtype=torch.float64)
    assert align(point, geometry.quat_to_matrix(turned), point, still, angles).aligned.all()


def test_how_a_step_is_made(chair):
    step = chair().steps[0]
    assert (step.grasp_from, step.approach, step.insertion, step.turn_height) == ("above", "above", 0, 0)
    said = {
        "grasp_from": "back",
        "approach": "axis",
        "insertion": 0.05,
        "clearance": 0.01,
        "travel_height": 0.1,
    }
    step = chair(lambda d: d["steps"][0].update(said, grip_angle=[0, -1, 0], turn_height=0.3)).steps[0]
    assert {name: getattr(step, name) for name in said} == said
    assert step.grip_angle == (0, -1, 0) and step.turn_height == 0.3


def test_quaternions_are_normalised():
    for name in furniture.names():
        for part in furniture.load(name).parts:
            for quat in (part.initial_pose[3:], *(c.quat for c in part.connectors)):
                assert math.hypot(*quat) == pytest.approx(1, abs=1e-12)


def test_furniture_is_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        furniture.load("table_lack").parts[0].density = 1


def test_unknown_furniture_is_told_the_nearest_name():
    with pytest.raises(FurnitureError, match="'table_lak': did you mean 'table_lack'.*valid:.*'table_lack'"):
        furniture.load("table_lak")


def test_every_file_loads():
    assert furniture.names() == tuple(sorted(path.stem for path in DATA.glob("*.yaml")))
    assert all(furniture.load(name).name == name for name in furniture.names())


def _delete(data, *path):
    for key in path[:-1]:
        data = data[key]
    del data[path[-1]]


def _set(data, *path_and_value):
    *path, last, value = path_and_value
    for key in path:
        data = data[key]
    data[last] = value


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda d: _delete(d, "z_finedist"), r"chair.yaml: z_finedist: is missing"),
        (lambda d: _set(d, "z_finedist", "high"), r"z_finedist: got 'high', expected a finite number"),
        (lambda d: _set(d, "z_fine", 1), r"z_fine: unknown field, did you mean 'z_finedist'"),
        (
            lambda d: _set(d, "parts", "seat", "density", -1),
            r"parts.seat.density: got -1, expected a positive",
        ),
        (lambda d: _set(d, "parts", "seat", "boxes", []), r"parts.seat.boxes: got none"),
        (
            lambda d: _set(d, "parts", "seat", "boxes", 0, "size", [1, 2]),
            r"parts.seat.boxes\[0\].size: got \[1, 2\], expected a list of 3 numbers",
        ),
        (
            lambda d: _set(d, "parts", "side", "initial_pose", [0, 0, 0, 2, 0, 0, 0]),
            r"parts.side.initial_pose: got quaternion .* of length 2.000",
        ),
        (
            lambda d: _set(d, "parts", "side", "grasps", 0, "right", [0.02, 0, -0.01]),
            r"parts.side.grasps\[0\]: left and right are both",
        ),
        (
            lambda d: _set(d, "steps", 0, "moving_part", "sied"),
            r"steps\[0\]: no part of 'chair' is called 'sied': did you mean 'side'",
        ),
        (
            lambda d: _set(d, "steps", 0, "target_connector", "right"),
            r"steps\[0\]: no connector of part 'seat' is called 'right': valid: 'left'",
        ),
        (
            lambda d: _set(d, "steps", 0, "moving_connector", "front"),
            r"connector side.front \('side-front', mates with 'front-side'\) cannot join seat.left",
        ),
        (lambda d: _set(d, "steps", 0, "degrees", 90), r"steps\[0\].angle: got 90 degrees, .* allows 0, 180"),
        (lambda d: _set(d, "steps", 0, "grasp", 2), r"steps\[0\].grasp: got 2, part 'side' has 2 grasps"),
        (
            lambda d: _set(d, "steps", 0, "grasp", 0.7),
            r"chair.yaml: steps\[0\].grasp: got 0.7, expected a whole number",
        ),
        (lambda d: _set(d, "steps", []), r"steps: got none"),
        (lambda d: _set(d, "parts", 7, {}), r"chair.yaml: parts: got 7, expected a name"),
        (
            lambda d: _set(d, "no_contact", [["seat", "sied"]]),
            r"no_contact\[0\]: no part of 'chair' is called 'sied': did you mean 'side'",
        ),
        (lambda d: _set(d, "no_contact", [["seat"]]), r"no_contact\[0\]: got \['seat'\], expected two"),
        (lambda d: _set(d, "no_contact", "seat"), r"no_contact: got 'seat', expected a list of lists"),
        (
            lambda d: _set(d, "parts", "side", "connectors", "seat", "pos", [0, 0, 1e9]),
            r"parts.side.connectors.seat.pos: got \[0.0, 0.0, 1000000000.0\], expected lengths in m, none beyond 2",
        ),
        (
            lambda d: _set(d, "parts", "side", "initial_pose", [5, 0, 0, 1, 0, 0, 0]),
            r"parts.side.initial_pose: got \[5.0, 0.0, 0.0\], expected lengths in m, none beyond 2",
        ),
        (
            lambda d: _set(d, "parts", "seat", "boxes", 0, "size", [3, 1, 1]),
            r"parts.seat.boxes\[0\].size: got \[3.0, 1.0, 1.0\], expected sizes in m from 0.0001 to 2",
        ),
        (
            lambda d: _set(d, "parts", "seat", "density", 1e6),
            r"parts.seat.density: got 1e\+06, expected a number of at most 20000",
        ),
        (
            lambda d: _set(d, "parts", "seat", "cylinders", [{"radius": 0, "half_length": 1}]),
            r"parts.seat.cylinders\[0\].radius: got 0.0, expected sizes in m",
        ),
        (
            lambda d: _set(d, "parts", "seat", "capsules", [{"radius": 0.1, "length": 1}]),
            r"parts.seat.capsules\[0\].half_length: is missing",
        ),
        (
            lambda d: _set(d, "parts", "side", "connectors", "seat", "allowed_degrees", "all"),
            r"parts.side.connectors.seat.allowed_degrees: got 'all', expected a list of numbers",
        ),
        (
            lambda d: _set(d, "steps", 0, "grip_angle", [0, 0, -2]),
            r"steps\[0\].grip_angle: got \[0.0, 0.0, -2.0\] of length 2.000",
        ),
        (
            lambda d: _set(d, "steps", 0, "grasp_from", "abov"),
            r"steps\[0\].grasp_from: got 'abov', did you mean 'above'\? valid: 'above', 'back'",
        ),
        (
            lambda d: _set(d, "steps", 0, "approach", "side"),
            r"steps\[0\].approach: got 'side', valid: 'above', 'axis'",
        ),
        (
            lambda d: _set(d, "steps", 0, "insertion", -0.1),
            r"steps\[0\].insertion: got -0.1, expected a number from 0",
        ),
        (
            lambda d: _set(d, "steps", 0, "clearance", 0),
            r"steps\[0\].clearance: got 0, expected a positive number",
        ),
        (
            lambda d: _set(d, "steps", 0, "travel_height", 0.01),
            r"steps\[0\].travel_height: got 0.01, .* from 0.06",
        ),
        (lambda d: _set(d, "steps", 0, "turn_height", 9), r"steps\[0\].turn_height: got 9, .* from 0 to 1"),
        (
            lambda d: _set(d, "steps", 0, "target_part", "side"),
            r"steps\[0\]: no connector of part 'side' is called 'left'",
        ),
        (lambda d: _set(d, "weld_impedance", 1), r"weld_impedance: got 1, expected a number between 0 and 1"),
    ],
)
def test_a_wrong_file_is_told_what_is_wrong(chair, change, message):
    with pytest.raises(FurnitureError, match=message):
        chair(change)


@pytest.mark.parametrize(
    "twice, message",
    [
        ("parts:\n  seat: {density: 1}\n  seat: {density: 2}\n", "parts.seat: stands twice, again in line 3"),
        ("steps: [{degrees: 1, degrees: 2}]", r"steps\[0\].degrees: stands twice, again in line 1"),
    ],
)
def test_a_name_that_stands_twice_is_refused(tmp_path, twice, message):
    path = tmp_path / "chair.yaml"
    path.write_text(twice)
    with pytest.raises(FurnitureError, match=f"chair.yaml: {message}"):
        read(path)
