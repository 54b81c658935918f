"""Where episodes begin: noise in its ranges, earlier steps preassembled, the arm home."""

import pytest
import torch
from torch.testing import assert_close
from worlds import PIECES, make, relative_poses

from tstar_envs import geometry
from tstar_envs.robots import sawyer


def test_start_noise_fills_its_ranges():
    world = make(256)
    off = world.task.part_poses - world.task.tables.initial_pose
    assert_close(off[..., :2].amax((0, 1)), torch.full((2,), 0.02, dtype=torch.float64), atol=6e-4, rtol=0)
    assert_close(off[..., :2].amin((0, 1)), torch.full((2,), -0.02, dtype=torch.float64), atol=6e-4, rtol=0)
    assert off[..., :2].mean().abs() < 1e-3 and off[..., 2].abs().max() < 2e-3
    start = world.task.tables.initial_pose[:, 3:].expand(256, -1, -1)
    turn = geometry.quat_mul(world.task.part_poses[..., 3:], geometry.quat_conj(start))
    degrees = (2 * turn[..., 3] * turn[..., 0].sign()).rad2deg()
    assert 2.9 < degrees.max() < 3.1 and -3.1 < degrees.min() < -2.9
    arm = world.physics.qpos[:, :7] - torch.tensor(sawyer.HOME_QPOS, dtype=torch.float64)
    assert 0.9e-3 < arm.abs().max() <= 1e-3 and arm.abs().min() > 0
    before = world.task.part_poses.clone()
    world.reset()
    assert (world.task.part_poses - before).abs().amax((1, 2)).min() > 1e-4


def test_no_noise_is_no_noise():
    world = make(3, part_noise=0.0, part_noise_degrees=0.0, arm_noise=0.0)
    assert torch.equal(world.observation()[0], world.observation()[1])


@pytest.mark.parametrize("name", PIECES)
def test_preassembled_ideal_and_jittered(name):
    ideal, jittered = make(32, 3, name=name), make(32, 3, name=name, preassembled="jitter")
    for step in range(3):
        assert (ideal.physics.eq_active[:, step] == 1).all() and (ideal.physics.eq_active[:, 3] == 0).all()
        wanted = ideal.task.tables.ideal_relative_pose(step)
        exact, off = relative_poses(ideal, step), relative_poses(jittered, step)
        assert (exact[:, :3] - wanted[:3]).norm(dim=-1).max() < 1.5e-3
        moving = ideal.task.tables.moving_connector[step, :3]
        ends = [
            pose[:, :3] + geometry.quat_rotate(pose[:, 3:], moving.expand(32, 3)) for pose in (exact, off)
        ]
        distance = (ends[0] - ends[1]).norm(dim=-1)
        assert distance.max() < 0.022 and distance.mean() > 0.004
        tilt = 2 * torch.acos((exact[:, 3:] * off[:, 3:]).sum(-1).abs().clamp_max(1)).rad2deg()
        assert tilt.max() < 5.5 and tilt.mean() > 1.0


def failing(world, rows, times):
    """Lets the simulations of `rows` fail the next `times` times that their parts settle."""
    settle, left = world.physics.settle, iter(range(times))

    def fail(mask, substeps):
        failed = settle(mask, substeps)
        failed[rows] |= next(left, None) is not None
        return failed

    world.physics.settle = fail


def test_a_start_that_fails_is_counted_and_drawn_again():
    plain, world = make(4, 1), make(4, 1)
    failing(world, [1, 3], times=2)
    mask = torch.tensor([True, True, True, False])
    for each in (plain, world):
        each.reset(mask)
    assert (plain.failures, world.failures) == (0, 2)  # simulation 1, twice; 3 was not being reset
    same = (plain.task.part_poses == world.task.part_poses).all(-1).all(-1)
    assert same.tolist() == [True, False, True, True]
    off = world.task.part_poses[1, -1, :2] - world.task.tables.initial_pose[-1, :2]
    assert off.abs().max() < 0.021 and not world.state["failed"].any()


def test_a_start_that_always_fails_is_an_error():
    world = make(2)
    failing(world, [0], times=100)
    with pytest.raises(RuntimeError, match="1 simulations failed while their parts settled, 10 times each"):
        world.reset()
