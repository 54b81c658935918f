"""The assembly task: observation, connecting, ends."""

import pytest
import torch
from torch import Tensor
from torch.testing import assert_close
from worlds import idle, make, part_pose, relative_poses, site_pose

from tstar_envs import geometry
from tstar_envs.environment import BatchedEnvironment
from tstar_envs.robots import sawyer
from tstar_envs.tasks import assembly
from tstar_rl.env import layout


def connect_one(world: BatchedEnvironment) -> Tensor:
    """Lets the expert go on until simulation 0 connects; the part poses before that step."""
    expert = world.expert()
    for _ in range(world.max_steps):
        action, before = expert.act(world.state), world.task.part_poses.clone()
        world.step(action)
        if world.state["completed"][0]:
            return before
    raise AssertionError("the expert did not connect")


def test_observation_layout():
    world = make()
    world.step(torch.full((4, 9), 0.3, dtype=torch.float64))
    observation, physics = world.observation(), world.physics
    assert observation.shape == (4, 72) and observation.dtype == torch.float64
    assert torch.equal(observation[:, :7], physics.qpos[:, :7])
    assert torch.equal(observation[:, 7:14], physics.qvel[:, :7]) and observation[:, 7:14].abs().min() > 1e-3
    assert torch.equal(observation[:, 14:16], physics.qpos[:, 7:9])
    position, matrix = site_pose(world, "grip_site")
    assert_close(observation[:, 16:19], position)
    assert_close(geometry.quat_to_matrix(observation[:, 19:23]), matrix)
    for i, part in enumerate(world.furniture.part_names):
        assert torch.equal(observation[:, 29 + 7 * i : 36 + 7 * i], part_pose(world, part))
    assert_close(observation[:, 64:].argmax(-1), world.state["phase"])
    assert_close(observation[:, 64:].sum(-1), torch.ones(4, dtype=torch.float64))
    assert (layout.JOINTS, layout.GRIP_POSITION, layout.HAND_QUAT) == (7, 16, 19)
    assert (layout.PARTS, layout.NUM_PHASES, layout.observation_size(5)) == (29, 8, 72)


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


def joints_after_connecting(**settings) -> tuple[BatchedEnvironment, Tensor]:
    """A world of which simulation 0 has just connected, without anybody putting its arm back, and the arm before."""
    world = make(2, None, reset_robot=False, **settings)
    expert = world.expert()
    while not world.state["completed"][0]:
        before = world.physics.qpos[:, :9].clone()
        world.step(expert.act(world.state))
    return world, before


def off_home(joints: Tensor) -> Tensor:
    """The joint that is furthest from home, rad."""
    return (joints[..., :7] - torch.tensor(sawyer.HOME_QPOS, dtype=torch.float64)).abs().amax(-1)


def test_an_arm_that_is_not_put_home_stays_with_its_hand_closed():
    world, before = joints_after_connecting()
    after = world.physics.qpos[:, :9]
    assert off_home(before)[0] > 0.5 and abs(off_home(after)[0] - off_home(before)[0]) < 0.1
    assert after[0, 7] < 0.5 * sawyer.FINGER_OPEN[0]
    assert (world.state["phase"][0], world.state["subtask"][0]) == (0, 1)


def test_an_arm_that_draws_back_opens_its_hand_and_moves_towards_home_no_faster_than_it_may():
    stayed, _ = joints_after_connecting()
    world, _ = joints_after_connecting(retreat_steps=6)
    arms = [each.physics.qpos[0, :7] for each in (stayed, world)]
    moved, limits = (arms[1] - arms[0]).abs(), 0.5 * torch.tensor(sawyer.JOINT_SPEEDS, dtype=torch.float64)
    assert off_home(arms[1]) < off_home(arms[0]) - 0.1
    assert (moved <= limits + 0.05).all(), "five steps of 0.1 s"
    assert_close(world.physics.qpos[0, 7:9], torch.tensor(sawyer.FINGER_OPEN).double(), atol=2e-3, rtol=0)
    assert not world.physics.ctrl[0, :7].any()
    assert world.state["episode_step"][0] == stayed.state["episode_step"][0], (
        "the time limit does not count it"
    )
    assert torch.equal(world.physics.qpos[1], stayed.physics.qpos[1]), "the other simulation does not notice"


def test_an_arm_that_may_draw_back_long_enough_arrives_home():
    world, _ = joints_after_connecting(retreat_steps=40)
    assert off_home(world.physics.qpos[0]) < 0.02


def test_a_simulation_that_fails_while_the_arm_draws_back_ends_its_episode(monkeypatch):
    world = make(2, None, reset_robot=False, retreat_steps=3)
    expert, step = world.expert(), world.physics.step
    monkeypatch.setattr(
        world.physics, "step", lambda n, mask=None: step(n, mask) if mask is None else mask.clone()
    )
    while not world.state["failed"].any():
        world.step(expert.act(world.state))
    failed = world.state["failed"]
    assert world.failures == int(failed.sum())
    assert not world.state["reward"][failed].any(), "a failure is paid nothing"
    assert not world.state["completed"].any() and not world.state["subtask"].any()
    assert torch.equal(world.task.get_termination(world.state)[0], failed)
    assert torch.isfinite(world.observation()).all()


def test_the_last_step_is_made_once():
    world = make(1, 3, reset_robot=False)
    connect_one(world)
    assert world.state["subtask"].item() == 4
    again = torch.tensor([[0.0] * 7 + [1.0, 1.0]], dtype=torch.float64)
    world.step(again)  # the hand still holds the part where it was joined
    scene = world.task.scene(world.state)
    assert scene.touching.all() and scene.aligned.all()
    assert (world.state["subtask"].item(), world.state["completed"].item()) == (4, 1)
    assert not world.state["success"].any()
    world.restore(world.snapshot())


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


def test_an_episode_that_begins_in_a_restored_state_was_paid_nothing_yet():
    world = make(1)
    expert = world.expert()
    while not world.state["success"].all():
        world.step(expert.act(world.state))
    after = make(1, 1)
    after.reset_to(world.snapshot())
    assert world.state["reward"].item() > 0 and after.state["reward"].item() == 0


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


@pytest.mark.parametrize(("action", "share"), [(-1.0, 0.0), (0.0, 0.5), (1.0, 1.0), (0.5, 0.75)])
def test_a_continuous_gripper_goes_as_far_as_it_is_told(action, share):
    world = make(1, gripper="continuous")
    told = idle(world)
    told[:, 7] = action
    world.step(told)
    opened, closed = (torch.tensor(fingers) for fingers in (sawyer.FINGER_OPEN, sawyer.FINGER_CLOSED))
    assert_close(world.physics.ctrl[0, 7:9], (opened + share * (closed - opened)).double(), atol=1e-7, rtol=0)


@pytest.mark.parametrize("subtask", [0, None])
def test_a_connection_that_disturbs_its_target_is_a_failure_but_for_the_last_of_an_episode(
    subtask, monkeypatch
):
    world = make(1, subtask, end_on_disturbance=True)
    monkeypatch.setattr(assembly, "moved", lambda scene: torch.ones(1, dtype=torch.float64))
    connect_one(world)
    terminated, truncated = world.task.get_termination(world.state)
    assert world.state["disturbed"].all() and terminated.all() and not truncated.any()
    assert world.state["success"].item() is (subtask == 0)


def test_a_disturbed_target_ends_the_episode_where_asked():
    for end in (False, True):
        world = make(1, end_on_disturbance=end)
        part_pose(world, "table_top")[:, 0] += 0.11
        world.step(idle(world))
        assert world.state["disturbed"].all() and world.task.get_termination(world.state)[0].item() is end


def test_an_episode_that_terminates_at_the_time_limit_is_not_truncated_too():
    world = make(1, max_steps=1, end_on_disturbance=True)
    part_pose(world, "table_top")[:, 0] += 0.11
    world.step(idle(world))
    terminated, truncated = world.task.get_termination(world.state)
    assert terminated.all() and not truncated.any()


def test_a_subtask_remembers_how_it_finds_the_world():
    """At the start, and after one and two connections; the arm stays where it was, so phase 0 begins each."""
    world = make(1, None, name="chair_ingolf", reset_robot=False)  # whose waypoints differ from step to step
    expert = world.expert()
    for done in range(3):
        state, scene = world.state, world.task.scene(world.state)
        assert state["subtask"].item() == done and state["phase"].item() == 0
        assert_close(state["start_tip"], scene.tip)
        assert_close(state["start_target"], scene.target_connector)
        assert_close(state["lift_point"], scene.part + world.task.tables.waypoint[done])
        assert_close(state["potential"], world.task.step_reward.potentials(scene))
        assert state["potential"][0, 0].item() == pytest.approx(-100.0)
        while done < 2 and world.state["completed"][0] == done:
            world.step(expert.act(world.state))
