"""The assembly task: observation, starts, connecting, ends, and whether the scripted expert can do it."""

import pytest
import torch
from torch import Tensor
from torch.testing import assert_close

import tstar_envs
from tstar_envs import geometry
from tstar_envs.environment import BatchedEnvironment
from tstar_envs.robots import sawyer

IDLE = torch.tensor([0.0] * 7 + [-1.0, -1.0], dtype=torch.float64)


PIECES = ("table_lack", "chair_ingolf")


def make(
    num_sims: int = 4, subtask: int | None = 0, seed: int = 0, name: str = "table_lack", **settings
) -> BatchedEnvironment:
    world = tstar_envs.load(name, num_sims, subtask, 1, seed, **settings)
    world.reset()
    return world


def idle(world: BatchedEnvironment) -> Tensor:
    return IDLE.repeat(world.num_sims, 1)


def run(world: BatchedEnvironment, act) -> tuple[Tensor, Tensor]:
    """One episode of every simulation: success (N,) and undiscounted return (N,)."""
    running = torch.ones(world.num_sims, dtype=torch.bool)
    success, returns = torch.zeros_like(running), torch.zeros(world.num_sims, dtype=torch.float64)
    while running.any():
        world.step(act(world.state))
        returns += world.state["reward"] * running
        success |= world.state["success"] & running
        terminated, truncated = world.task.get_termination(world.state)
        running &= ~(terminated | truncated)
    return success, returns


def connect_one(world: BatchedEnvironment) -> Tensor:
    """Lets the expert go on until simulation 0 connects; the part poses before that step."""
    expert = world.expert()
    for _ in range(world.max_steps):
        action, before = expert.act(world.state), world.task.part_poses.clone()
        world.step(action)
        if world.state["completed"][0]:
            return before
    raise AssertionError("the expert did not connect")


def relative_poses(world: BatchedEnvironment, step: int) -> Tensor:
    """(N, 7) of the moving part in its target's frame."""
    tables, poses = world.task.tables, world.task.part_poses
    target, moving = poses[:, tables.target[step]], poses[:, tables.moving[step]]
    return torch.cat(
        geometry.relative_pose(target[:, :3], target[:, 3:], moving[:, :3], moving[:, 3:]), dim=-1
    )


def aligned(world: BatchedEnvironment) -> Tensor:
    return world.task.scene(world.state).alignment.aligned


def test_observation_layout():
    world = make()
    world.step(torch.full((4, 9), 0.3, dtype=torch.float64))
    observation, physics = world.observation(), world.physics
    assert observation.shape == (4, 72) and observation.dtype == torch.float64
    assert torch.equal(observation[:, :7], physics.qpos[:, :7])
    assert torch.equal(observation[:, 7:14], physics.qvel[:, :7]) and observation[:, 7:14].abs().min() > 1e-3
    assert torch.equal(observation[:, 14:16], physics.qpos[:, 7:9])
    position, matrix = physics.site_pose("grip_site")
    assert_close(observation[:, 16:19], position)
    assert_close(geometry.quat_to_matrix(observation[:, 19:23]), matrix)
    for i, part in enumerate(world.furniture.part_names):
        assert torch.equal(observation[:, 29 + 7 * i : 36 + 7 * i], physics.body_pose(part))
    assert_close(observation[:, 64:].argmax(-1), world.state["phase"])
    assert_close(observation[:, 64:].sum(-1), torch.ones(4, dtype=torch.float64))


def test_hand_velocities_are_the_rates_of_its_pose():
    world = make(1)
    action = idle(world)
    action[:, :7] = torch.tensor([0.2, -0.1, 0.15, 0.1, -0.2, 0.1, 0.3])
    for _ in range(8):
        before = world.observation()
        world.step(action)
    after = world.observation()
    mean = (before[:, 23:29] + after[:, 23:29]) / 2
    assert_close((after - before)[:, 16:19] / 0.1, mean[:, :3], atol=5e-3, rtol=0.02)
    turn = geometry.quat_mul(after[:, 19:23], geometry.quat_conj(before[:, 19:23]))
    assert_close(2 * turn[:, 1:] / 0.1, mean[:, 3:], atol=5e-3, rtol=0.02)


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


@pytest.mark.parametrize("subtask", range(4))
def test_a_subtask_begins_at_phase_one_with_the_arm_home(subtask):
    world = make(4, subtask)
    assert (world.state["phase"] == 1).all() and (world.state["subtask"] == subtask).all()
    assert not world.state["completed"].any() and not world.state["episode_step"].any()


def test_connecting_welds_the_parts_as_met_and_sends_the_arm_home():
    world = make(1)
    before = connect_one(world)
    assert (
        world.state["success"].all()
        and (world.state["subtask"] == 1).all()
        and (world.state["phase"] == 1).all()
    )
    met = relative_poses(world, 0)
    ideal = world.task.tables.ideal_relative_pose(0)
    assert 1e-4 < (met - ideal)[:, :3].norm() < 0.05
    assert_close(world.physics.eq_data[:, 0, 3:10], met)
    assert (world.task.part_poses - before).abs().max() < 0.03
    home = torch.tensor([[*sawyer.HOME_QPOS, *sawyer.FINGER_OPEN]], dtype=torch.float64)
    assert torch.equal(world.physics.qpos[:, :9], home) and not world.physics.qvel[:, :9].any()
    for _ in range(20):
        world.step(idle(world))
    assert_close(relative_poses(world, 0), met, atol=2e-3, rtol=0)


def test_snap_welds_at_the_ideal_pose():
    world = make(1, snap=True)
    connect_one(world)
    assert_close(relative_poses(world, 0)[0], world.task.tables.ideal_relative_pose(0))


def test_step_limits():
    assert make(1).max_steps == 200 and make(1, None).max_steps == 800
    world = make(2, max_steps=5)
    ends = []
    for _ in range(5):
        world.step(idle(world))
        ends.append([flag.all().item() for flag in world.task.get_termination(world.state)])
    assert ends == [[False, False]] * 4 + [[False, True]]


def test_nothing_connects_without_asking_or_holding():
    world = make(2)
    asking = idle(world)
    asking[:, 8] = 1.0
    world.step(asking)
    assert not world.state["completed"].any() and not world.state["wrong"].any()
    expert = world.expert()
    for _ in range(60):
        action = expert.act(world.state)
        action[:, 8] = -1.0
        world.step(action)
    assert aligned(world).any() and not world.state["completed"].any()
    assert not world.physics.eq_active.any()


def test_a_wrong_connection_ends_the_episode():
    """The expert of step 1 holds its part right; the task is told that it is at step 0."""
    world = make(1, 1)
    expert = world.expert()
    for _ in range(80):
        action = expert.act(world.state)
        if action[0, 8] > 0:
            break
        world.step(action)
    world.state["subtask"] = torch.zeros_like(world.state["subtask"])
    world.step(action)
    assert world.state["wrong"].all() and not world.state["success"].any()
    assert world.task.get_termination(world.state)[0].all()


def test_a_disturbed_target_ends_the_episode_where_asked():
    for end in (False, True):
        world = make(1, end_on_disturbance=end)
        world.physics.body_pose("table_top")[:, 0] += 0.11
        world.step(idle(world))
        assert world.state["disturbed"].all() and world.task.get_termination(world.state)[0].item() is end


@pytest.mark.parametrize(("subtask", "bonuses"), [(0, 25_000), (1, 25_000), (2, 40_000), (3, 25_000)])
def test_the_expert_is_paid_for_the_chair(subtask, bonuses):
    """Three bonuses of 5,000 up to the grasp and 10,000 for connecting; the long step passes the phases between too."""
    world = make(4, subtask, name="chair_ingolf", velocity_scale=0.4)
    success, returns = run(world, world.expert().act)
    assert success.all() and returns.min() > bonuses


def test_the_expert_returns_more_than_chance():
    world = make(8)
    _, expert = run(world, world.expert().act)
    world = make(8)
    chance = torch.Generator().manual_seed(0)
    success, random = run(world, lambda _: 2 * torch.rand(8, 9, generator=chance, dtype=torch.float64) - 1)
    assert expert.min() > 40_000 and random.max() < 10_000 and not success.any()


QUICK, LONG = 16, 64


@pytest.mark.parametrize("name", PIECES)
@pytest.mark.parametrize("subtask", range(4))
@pytest.mark.parametrize("speed", [1.0, 0.4])
@pytest.mark.parametrize(
    ("episodes", "preassembled"),
    [(QUICK, "ideal"), *(pytest.param(LONG, how, marks=pytest.mark.slow) for how in ("ideal", "jitter"))],
)
def test_the_expert_assembles_every_subtask(name, subtask, speed, episodes, preassembled):
    world = make(episodes, subtask, seed=1, name=name, velocity_scale=speed, preassembled=preassembled)
    success, _ = run(world, world.expert().act)
    wanted = {"table_lack": 0.98, "chair_ingolf": 0.95}[name] if episodes == LONG else 0.9
    assert success.double().mean() >= wanted and not world.state["wrong"].any()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "speed", "wanted"),
    [("table_lack", 1.0, 0.92), ("chair_ingolf", 1.0, 0.85), ("chair_ingolf", 0.4, 0.85)],
)
def test_the_expert_assembles_the_whole_piece(name, speed, wanted):
    world = make(200, None, seed=1, name=name, velocity_scale=speed)
    success, _ = run(world, world.expert().act)
    assert success.double().mean() >= wanted
