"""The connection rule on numbers worked by hand."""

import math

import pytest
import torch
from torch import Tensor
from torch.testing import assert_close

import tstar_envs
from tstar_envs.connection import MAX_DISTANCE, align, padded
from tstar_envs.geometry import axis_angle_quat, quat_to_matrix, yaw_quat

QUARTERS = torch.tensor([[0.0, 90.0, 180.0, 270.0]], dtype=torch.float64).deg2rad()
ZERO = torch.zeros(1, 3, dtype=torch.float64)
UPRIGHT = torch.eye(3, dtype=torch.float64).unsqueeze(0)


def turned(degrees: float) -> Tensor:
    return quat_to_matrix(yaw_quat(torch.tensor([math.radians(degrees)], dtype=torch.float64)))


def tilted(degrees: float) -> Tensor:
    axis = torch.tensor([[1.0, 0.0, 0.0]], dtype=torch.float64)
    return quat_to_matrix(axis_angle_quat(axis, torch.tensor([math.radians(degrees)], dtype=torch.float64)))


def at(x: float, y: float, z: float) -> Tensor:
    return torch.tensor([[x, y, z]], dtype=torch.float64)


def test_fields_by_hand():
    # The target is 3-4-5 away along y and z; moving is tilted by 60 degrees about x: z -> (0, -sin 60, cos 60).
    found = align(ZERO, tilted(60.0), at(0, 0.03, 0.04), UPRIGHT, torch.zeros(1, 1, dtype=torch.float64))
    assert_close(found.distance.item(), 0.05)
    assert_close(found.up_cosine.item(), 0.5)
    assert_close(found.forward_cosine.item(), 0.5)
    assert_close(found.moving_projection.item(), -math.sin(math.pi / 3) * 0.6 + 0.5 * 0.8)
    assert_close(found.target_projection.item(), 0.8)
    assert not found.aligned.item()


@pytest.mark.parametrize(("distance", "expected"), [(0.0199, True), (0.0201, False)])
def test_distance_decides(distance, expected):
    assert MAX_DISTANCE == 0.02
    assert align(ZERO, UPRIGHT, at(distance, 0, 0), UPRIGHT, QUARTERS).aligned.item() is expected


@pytest.mark.parametrize(("degrees", "expected"), [(8.0, True), (8.2, False)])  # cos 8.11 degrees = 0.99
def test_tilt_and_turn_decide(degrees, expected):
    assert align(ZERO, tilted(degrees), ZERO, UPRIGHT, QUARTERS).aligned.item() is expected
    assert align(ZERO, turned(degrees), ZERO, UPRIGHT, QUARTERS).aligned.item() is expected
    assert align(ZERO, turned(90 - degrees), ZERO, UPRIGHT, QUARTERS).aligned.item() is expected


def test_upside_down_is_not_aligned():
    assert not align(ZERO, tilted(180.0), ZERO, UPRIGHT, QUARTERS).aligned.item()


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_only_allowed_turns_count(sign):
    """The target turned by an allowed angle about its own z: the sense of the turn matters."""
    allowed = torch.tensor([[math.radians(50.0)]], dtype=torch.float64)
    found = align(ZERO, turned(sign * 50.0), ZERO, UPRIGHT, allowed)
    assert found.aligned.item() is (sign > 0)
    assert_close(found.forward_cosine.item(), 1.0 if sign > 0 else math.cos(math.radians(100.0)))


def test_rows_are_padded_with_their_first_angle():
    assert padded([(1.0,), (2.0, 3.0, 4.0)]) == [(1.0, 1.0, 1.0), (2.0, 3.0, 4.0)]


@pytest.fixture(scope="module")
def world():
    world = tstar_envs.load("table_lack", 1, subtask=0, nthread=1, seed=0)
    world.reset()
    return world


def poses_with(world, step: int) -> Tensor:
    """Part poses with only the connection of `step` made, the other parts far away from each other."""
    tables = world.task.tables
    poses = torch.zeros(1, tables.num_parts, 7, dtype=torch.float64)
    poses[..., 3], poses[0, :, 0] = 1.0, 10.0 * torch.arange(tables.num_parts)
    ideal, target = tables.ideal_relative_pose(step), int(tables.target[step])
    pose = ideal.clone()
    pose[:3] += poses[0, target, :3]
    poses[0, int(tables.moving[step])] = pose
    return poses


@pytest.mark.parametrize("made", range(4))
@pytest.mark.parametrize("subtask", range(4))
def test_a_connection_of_a_later_step_is_wrong(world, made, subtask):
    tables = world.task.tables
    held = torch.zeros(1, tables.num_parts, dtype=torch.bool)
    wrong, now = world.task._wrong.made, torch.tensor([subtask])
    assert not wrong(poses_with(world, made), held, now).item()
    held[0, tables.moving[made]] = True
    assert wrong(poses_with(world, made), held, now).item() is (made > subtask)


def test_the_right_part_at_another_parts_connector_is_wrong(world):
    tables = world.task.tables
    poses = poses_with(world, 2)
    poses[0, tables.moving[0]], poses[0, tables.moving[2], 0] = poses[0, tables.moving[2]].clone(), 99.0
    held = torch.zeros(1, tables.num_parts, dtype=torch.bool)
    held[0, tables.moving[0]] = True
    assert world.task._wrong.made(poses, held, torch.tensor([0])).item()
