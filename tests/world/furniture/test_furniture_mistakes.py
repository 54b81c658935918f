"""What a wrong furniture file is told: the file, the field, what was got and what is valid."""

import pytest
from chair_file import put

from tstar_envs import furniture
from tstar_envs.furniture import FurnitureError, library
from tstar_envs.furniture.library import read


def delete(data, *path):
    for key in path[:-1]:
        data = data[key]
    del data[path[-1]]


@pytest.mark.parametrize("odd", ["my stool.yaml", ".#table_lack.yaml", "._x.yaml", "table__lack.yaml"])
def test_a_file_of_an_odd_name_is_no_piece(odd, tmp_path, monkeypatch):
    for name in ("table_lack.yaml", odd):
        (tmp_path / name).write_text((library.DATA / "table_lack.yaml").read_text())
    monkeypatch.setattr(library, "DATA", tmp_path)
    assert library.names() == ("table_lack",)


def test_unknown_furniture_is_told_the_nearest_name():
    with pytest.raises(FurnitureError, match="'table_lak': did you mean 'table_lack'.*valid:.*'table_lack'"):
        furniture.load("table_lak")


@pytest.mark.parametrize(
    "change, message",
    [
        (lambda d: delete(d, "z_finedist"), r"chair.yaml: z_finedist: is missing"),
        (
            lambda d: d.update(z_finedst=d.pop("z_finedist")),
            r"chair.yaml: z_finedist: is missing; is 'z_finedst' meant\?",
        ),
        (lambda d: put(d, "z_finedist", "high"), r"z_finedist: got 'high', expected a finite number$"),
        (
            lambda d: put(d, "z_finedist", "5e-2"),
            r"expected a finite number; YAML reads that as a word, write 0.05",
        ),
        (lambda d: put(d, "z_fine", 1), r"z_fine: unknown field, did you mean 'z_finedist'"),
        (
            lambda d: put(d, "parts", "seat", "density", -1),
            r"parts.seat.density: got -1, expected a positive",
        ),
        (lambda d: put(d, "parts", "seat", "boxes", []), r"parts.seat.boxes: got none"),
        (
            lambda d: put(d, "parts", "seat", "boxes", 0, "size", [1, 2]),
            r"parts.seat.boxes\[0\].size: got \[1, 2\], expected a list of 3 numbers",
        ),
        (
            lambda d: put(d, "parts", "side", "initial_pose", [0, 0, 0, 2, 0, 0, 0]),
            r"parts.side.initial_pose: got quaternion .* of length 2.000",
        ),
        (
            lambda d: put(d, "parts", "side", "grasps", 0, "right", [0.02, 0, -0.01]),
            r"parts.side.grasps\[0\]: left and right are both",
        ),
        (
            lambda d: put(d, "steps", 0, "moving_part", "sied"),
            r"steps\[0\]: no part of 'chair' is called 'sied': did you mean 'side'",
        ),
        (
            lambda d: put(d, "steps", 0, "target_connector", "right"),
            r"steps\[0\]: no connector of part 'seat' is called 'right': valid: 'left'",
        ),
        (
            lambda d: put(d, "steps", 0, "moving_connector", "front"),
            r"connector side.front \('side-front', mates with 'front-side'\) cannot join seat.left",
        ),
        (
            lambda d: put(d, "steps", 0, "degrees", 90),
            r"steps\[0\].degrees: got 90 degrees, .* allows 0, 180",
        ),
        (
            lambda d: put(d, "steps", 0, "grasp", 2),
            r"steps\[0\].grasp: got 2, valid: 0 to 1, the grasps of side",
        ),
        (
            lambda d: d["parts"]["side"].pop("grasps"),
            r"parts.side.grasps: got none, steps\[0\] moves the part",
        ),
        (
            lambda d: put(d, "steps", 0, "grasp", 0.7),
            r"chair.yaml: steps\[0\].grasp: got 0.7, expected a whole number",
        ),
        (lambda d: put(d, "steps", []), r"steps: got none"),
        (lambda d: put(d, "parts", 7, {}), r"chair.yaml: parts: got 7, expected a name"),
        (
            lambda d: put(d, "no_contact", [["seat", "sied"]]),
            r"no_contact\[0\]: no part of 'chair' is called 'sied': did you mean 'side'",
        ),
        (lambda d: put(d, "no_contact", [["seat"]]), r"no_contact\[0\]: got \['seat'\], expected two"),
        (lambda d: put(d, "no_contact", "seat"), r"no_contact: got 'seat', expected a list of lists"),
        (
            lambda d: put(d, "parts", "side", "connectors", "seat", "pos", [0, 0, 1e9]),
            r"parts.side.connectors.seat.pos: got \[0.0, 0.0, 1000000000.0\], expected lengths in m, none beyond 2",
        ),
        (
            lambda d: put(d, "parts", "side", "initial_pose", [5, 0, 0, 1, 0, 0, 0]),
            r"parts.side.initial_pose: got \[5.0, 0.0, 0.0\], expected lengths in m, none beyond 2",
        ),
        (
            lambda d: put(d, "parts", "seat", "boxes", 0, "size", [1.5, 1, 1]),
            r"parts.seat.boxes\[0\].size: got \[1.5, 1.0, 1.0\], expected half-sizes in m from 0.0001 to 1$",
        ),
        (
            lambda d: put(d, "parts", "seat", "density", 1e6),
            r"parts.seat.density: got 1e\+06, expected a number of at most 20000",
        ),
        (
            lambda d: put(d, "parts", "seat", "cylinders", [{"radius": 0, "half_length": 1}]),
            r"parts.seat.cylinders\[0\].radius: got 0.0, expected half-sizes in m",
        ),
        (
            lambda d: put(d, "parts", "seat", "capsules", [{"radius": 0.1, "length": 1}]),
            r"parts.seat.capsules\[0\].half_length: is missing",
        ),
        (
            lambda d: put(d, "parts", "side", "connectors", "seat", "allowed_degrees", "all"),
            r"parts.side.connectors.seat.allowed_degrees: got 'all', expected a list of numbers, or the word any$",
        ),
        (
            lambda d: put(d, "steps", 0, "grip_angle", [0, 0, -2]),
            r"steps\[0\].grip_angle: got \[0.0, 0.0, -2.0\] of length 2.000",
        ),
        (
            lambda d: put(d, "steps", 0, "grasp_from", "abov"),
            r"steps\[0\].grasp_from: got 'abov', did you mean 'above'\? valid: 'above', 'back'",
        ),
        (
            lambda d: put(d, "steps", 0, "approach", "side"),
            r"steps\[0\].approach: got 'side', valid: 'above', 'axis'",
        ),
        (
            lambda d: put(d, "steps", 0, "insertion", -0.1),
            r"steps\[0\].insertion: got -0.1, expected a number from 0",
        ),
        (
            lambda d: put(d, "steps", 0, "clearance", 0),
            r"steps\[0\].clearance: got 0, expected a positive number",
        ),
        (
            lambda d: put(d, "steps", 0, "travel_height", 0.01),
            r"steps\[0\].travel_height: got 0.01, .* from 0.06",
        ),
        (lambda d: put(d, "steps", 0, "turn_height", 9), r"steps\[0\].turn_height: got 9, .* from 0 to 1"),
        (
            lambda d: put(d, "steps", 0, "target_part", "side"),
            r"steps\[0\]: no connector of part 'side' is called 'left'",
        ),
        (
            lambda d: put(d, "steps", {"first": d["steps"][0]}),
            r"steps: got {'first': .*, expected a list",
        ),
        (
            lambda d: put(d, "parts", "seat", "cylinders", {"a": {"radius": 0.1, "half_length": 0.1}}),
            r"parts.seat.cylinders: got {'a': .*, expected a list",
        ),
        (
            lambda d: put(d, "parts", list(d["parts"].values())),
            r"parts: got \[.*, expected a mapping of names",
        ),
        (
            lambda d: d["steps"].append(dict(d["steps"][0])),
            r"steps\[1\]: side and seat are one piece by then, joined by the steps before",
        ),
        (lambda d: put(d, "weld_impedance", 1), r"weld_impedance: got 1, expected a number between 0 and 1"),
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
