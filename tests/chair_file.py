"""A chair's file of two parts and one step, which tests of furniture files change."""

from typing import Any

import pytest
import yaml

from tstar_envs.furniture.library import read

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


def put(data: dict, *path_and_value: Any) -> None:
    """Sets the value at a path, which comes last."""
    *path, last, value = path_and_value
    for key in path:
        data = data[key]
    data[last] = value
