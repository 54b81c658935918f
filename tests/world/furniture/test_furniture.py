"""Furniture files: what they say."""

import dataclasses
import math
from functools import cache

import mujoco
import pytest
import torch
from chair_file import put

from tstar_envs import furniture, geometry
from tstar_envs.connection import align
from tstar_envs.furniture import FurnitureError, library
from tstar_envs.furniture.library import DATA
from tstar_envs.scene import build_model


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


def test_the_digest_of_a_piece_is_of_what_its_file_says_and_not_of_comments(tmp_path, monkeypatch):
    text = (DATA / "table_lack.yaml").read_text()
    before = library.digest("table_lack")
    monkeypatch.setattr(library, "DATA", tmp_path)
    monkeypatch.setattr(library, "_load", cache(library._load.__wrapped__))
    file = tmp_path / "table_lack.yaml"
    file.write_text(f"# a comment\n{text}")
    assert library.digest("table_lack") == before
    assert "density: 300" in text
    library._load.cache_clear()
    file.write_text(text.replace("density: 300", "density: 301"))
    changed = library.digest("table_lack")
    assert changed != before
    file.write_text("half a fi")  # what is simulated is what was read, whatever the file says by now
    assert (
        library.digest("table_lack") == changed
        and library.load("table_lack").part("table_top").density == 301
    )


def test_pieces_may_lie_in_folders_of_a_users_own(tmp_path, monkeypatch):
    monkeypatch.setattr(library, "_load", cache(library._load.__wrapped__))
    text = (DATA / "table_lack.yaml").read_text()
    (tmp_path / "my_table.yaml").write_text(text)
    with pytest.raises(FurnitureError, match="no furniture is called 'my_table'"):
        library.load("my_table")
    monkeypatch.setenv(
        library.FURTHER, f"{tmp_path}:{tmp_path}:{DATA}"
    )  # a folder that is named twice is one
    assert "my_table" in library.names() and "table_lack" in library.names()
    assert library.load("my_table").part_names == library.load("table_lack").part_names
    assert library.digest("my_table") == library.digest("table_lack")
    (tmp_path / "chair_agne.yaml").write_text(text)
    with pytest.raises(
        FurnitureError, match="two pieces are called 'chair_agne': .*; rename one of the files"
    ):
        library.load("chair_agne")
    (tmp_path / "my_stool.yaml").symlink_to(tmp_path / "moved_away.yaml")
    monkeypatch.setenv(library.FURTHER, str(tmp_path))
    assert "my_stool" not in library.names()
    with pytest.raises(FurnitureError, match="no furniture is called 'my_stool'"):
        library.load("my_stool")
    monkeypatch.setenv(library.FURTHER, str(tmp_path / "nowhere"))
    with pytest.raises(FurnitureError, match="TSTAR_FURNITURE names .*nowhere, which is no folder"):
        library.names()


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


def test_a_part_s_centre_of_mass_is_mujoco_s(chair):
    place = {"pos": [0.02, 0, 0.1], "quat": [0.6, 0.8, 0, 0]}
    round_shapes = {
        "cylinders": [{"radius": 0.02, "half_length": 0.1, **place}],
        "capsules": [{"radius": 0.03, "half_length": 0.02, "pos": [0, 0.05, 0]}],
    }
    piece = chair(lambda d: d["parts"]["side"].update(round_shapes))
    for part in piece.parts:
        assert build_model(piece).body(part.name).ipos == pytest.approx(part.centre_of_mass, abs=1e-12)


def test_a_round_connector_fits_at_any_turn(chair):
    piece = chair(lambda d: put(d, "parts", "side", "connectors", "seat", "allowed_degrees", "any"))
    connector = piece.part("side").connector("seat")
    chair(
        lambda d: (
            put(d, "parts", "side", "connectors", "seat", "allowed_degrees", "any"),
            put(d, "steps", 0, "degrees", 45),
        )
    )
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


def test_every_file_loads():
    assert furniture.names() == tuple(sorted(path.stem for path in DATA.glob("*.yaml")))
    assert all(furniture.load(name).name == name for name in furniture.names())
