"""Where episodes begin: noise in its ranges, earlier steps preassembled, the arm home."""

import mujoco
import pytest
import torch
from torch.testing import assert_close
from worlds import PIECES, make, relative_poses

from tstar_envs import geometry
from tstar_envs.robots import sawyer
from tstar_envs.tasks.episode_start import MIN_CLEARANCE, StartError


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


@pytest.mark.parametrize("name", PIECES)
def test_a_jittered_part_keeps_clear_of_its_target_on_the_side_it_comes_from(name, monkeypatch):
    """Before anything settles, along the target connector's up axis."""
    world = make(64, None, name=name, preassembled="jitter")
    monkeypatch.setattr(world.physics, "settle", lambda mask, steps: torch.zeros_like(mask))
    world.task.starts.place(torch.ones(64, dtype=torch.bool), 3)
    tables = world.task.tables
    for step in range(3):
        pose, goal = relative_poses(world, step), tables.target_connector[step]
        point = pose[:, :3] + geometry.quat_rotate(
            pose[:, 3:], tables.moving_connector[step, :3].expand(64, 3)
        )
        up = geometry.up_axis(goal[3:])
        body = tables.ideal_relative_pose(step)[:3] - goal[:3]  # the middle of the part where it belongs
        away = (point - goal[:3]) @ up * (body @ up).sign()
        assert away.min() >= MIN_CLEARANCE - 1e-9
        assert 0.01 < away.max() <= 0.012 + MIN_CLEARANCE + 1e-9


def test_parts_start_above_where_they_are_laid_out(monkeypatch):
    world = make(4, drop_height=0.03)
    monkeypatch.setattr(world.physics, "settle", lambda mask, steps: torch.zeros_like(mask))
    world.reset()
    height = world.task.part_poses[..., 2] - world.task.tables.initial_pose[:, 2]
    assert_close(height, torch.full_like(height, 0.03))


@pytest.mark.parametrize(("subtask", "bounds"), [(1, (0.01, 0.08)), (3, (0.06, 0.2))])
def test_few_settled_parts_reach_into_their_target_and_not_far(subtask, bounds):
    """docs/task.md has the figures of 600 starts."""
    world = make(150, subtask, preassembled="jitter")
    data, top = mujoco.MjData(world.model), world.model.body("table_top").id
    legs = {world.model.body(f"leg_{i}").id for i in range(1, 5)}
    deepest = []
    for qpos in world.physics.qpos.numpy():
        data.qpos[:] = qpos
        mujoco.mj_forward(world.model, data)
        pairs = [({*world.model.geom_bodyid[c.geom]}, -c.dist) for c in data.contact]
        deepest.append(max((depth for pair, depth in pairs if top in pair and pair & legs), default=0.0))
    depth = torch.tensor(deepest)
    assert bounds[0] < (depth > 0).double().mean() < bounds[1] and depth.max() < 0.7e-3


def test_starts_made_in_advance_are_those_that_all_simulations_would_have_begun_with():
    """Where simulators can only step together, as on a GPU: N starts are made at once, and handed out in order."""
    plain, world = make(3, 1), make(3, 1)
    world.physics.steps_together = True
    for each in (plain, world):
        each.seed(5)
    plain.reset()
    before = world.snapshot()
    one, two = torch.tensor([False, True, False]), torch.tensor([True, False, True])
    world.reset(one)
    kept = two.nonzero().squeeze(-1)
    assert torch.equal(world.snapshot()["physics"][kept], before["physics"][kept])
    world.reset(two)
    assert torch.equal(world.physics.qpos[[1, 0, 2]], plain.physics.qpos)
    world.seed(5)  # forgets what was made
    world.reset()
    assert torch.equal(world.physics.qpos, plain.physics.qpos)


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
    with pytest.raises(
        RuntimeError, match="^table_lack, subtask 0: 1 simulations failed while their parts settled, 10 "
    ):
        world.reset()


def test_where_starts_are_made_together_an_error_leaves_the_simulations_as_they_were():
    world = make(3)
    world.physics.steps_together = True
    world.task.starts.forget()
    before = world.snapshot()["physics"]
    failing(world, [0], times=100)
    with pytest.raises(StartError):
        world.reset(torch.tensor([False, True, False]))
    assert torch.equal(world.snapshot()["physics"], before)
