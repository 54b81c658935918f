"""Geometry on numbers worked by hand."""

import math

import pytest
import torch
from torch import tensor
from torch.testing import assert_close

from tstar_envs import geometry as g

HALF = math.sqrt(0.5)
YAW_90 = tensor([HALF, 0.0, 0.0, HALF])  # x -> y, y -> -x
ROLL_90 = tensor([HALF, HALF, 0.0, 0.0])  # y -> z, z -> -y


def random_quats(n: int, dtype=torch.float64) -> torch.Tensor:
    q = torch.randn(n, 4, dtype=dtype, generator=torch.Generator().manual_seed(0))
    return q / q.norm(dim=-1, keepdim=True)


def test_product_rotates_first_by_the_second():
    # z --yaw--> z --roll--> -y
    assert_close(
        g.quat_rotate(g.quat_mul(ROLL_90, YAW_90), tensor([0.0, 0.0, 1.0])), tensor([0.0, -1.0, 0.0])
    )
    # z --roll--> -y --yaw--> x
    assert_close(g.quat_rotate(g.quat_mul(YAW_90, ROLL_90), tensor([0.0, 0.0, 1.0])), tensor([1.0, 0.0, 0.0]))
    assert_close(g.quat_mul(YAW_90, YAW_90), tensor([0.0, 0.0, 0.0, 1.0]))


def test_rotation_by_a_quarter_turn():
    assert_close(g.quat_rotate(YAW_90, tensor([1.0, 2.0, 3.0])), tensor([-2.0, 1.0, 3.0]))
    assert_close(g.quat_rotate(g.quat_conj(YAW_90), tensor([-2.0, 1.0, 3.0])), tensor([1.0, 2.0, 3.0]))


def test_rotation_broadcasts():
    vectors = torch.eye(3)
    assert_close(g.quat_rotate(YAW_90, vectors), tensor([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    assert g.quat_rotate(random_quats(5)[:, None], vectors.double()).shape == (5, 3, 3)


def test_matrix_of_a_quarter_turn():
    assert_close(g.quat_to_matrix(YAW_90), tensor([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))


def test_matrix_and_quaternion_rotate_alike():
    q, v = random_quats(64), torch.arange(192, dtype=torch.float64).reshape(64, 3)
    assert_close(g.quat_rotate(q, v), torch.einsum("nij,nj->ni", g.quat_to_matrix(q), v))
    assert_close(g.up_axis(q), g.quat_to_matrix(q)[..., 2])


def test_axis_angle_and_yaw():
    angle = tensor([math.pi / 2, math.pi])
    assert_close(g.yaw_quat(angle), tensor([[HALF, 0, 0, HALF], [0.0, 0, 0, 1]]))
    assert_close(g.axis_angle_quat(tensor([0.0, 0.0, 1.0]), angle), g.yaw_quat(angle))
    assert_close(g.axis_angle_quat(tensor([1.0, 0.0, 0.0]), tensor(math.pi / 2)), ROLL_90)


def test_poses_relative_and_composed():
    # Frame 1 stands at (1, 0, 0) and looks along world y: the point (1, 2, 0) is 2 m along its x.
    p1, p2 = tensor([1.0, 0.0, 0.0]), tensor([1.0, 2.0, 0.0])
    p, q = g.relative_pose(p1, YAW_90, p2, YAW_90)
    assert_close(p, tensor([2.0, 0.0, 0.0]))
    assert_close(q, tensor([1.0, 0.0, 0.0, 0.0]))
    back_p, back_q = g.compose_pose(p1, YAW_90, p, q)
    assert_close(back_p, p2)
    assert_close(back_q, YAW_90)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_dtype_is_kept(dtype):
    q, v = random_quats(3, dtype), torch.ones(3, 3, dtype=dtype)
    outs = [
        g.quat_mul(q, q),
        g.quat_rotate(q, v),
        g.quat_to_matrix(q),
        g.up_axis(q),
        g.yaw_quat(v[:, 0]),
    ]
    assert all(out.dtype == dtype for out in outs)


def test_the_least_turn_of_the_x_axis():
    assert_close(g.frame_with_x(tensor([0.0, 1.0, 0.0])), YAW_90)
    for axis in ([1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.6, 0.0, -0.8]):
        assert_close(g.quat_rotate(g.frame_with_x(tensor(axis)), tensor([1.0, 0.0, 0.0])), tensor(axis))
