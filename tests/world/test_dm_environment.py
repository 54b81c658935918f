"""The dm_env front: dm_env's own contract, and the same bits as the batched environment."""

import copy
import pickle

import dm_env
import numpy as np
import pytest
import torch
from absl.testing import absltest
from dm_env import test_utils

from tstar_envs import load_dm
from tstar_envs.environment import BatchedEnvironment

TASK = "table_lack"


class TestContract(test_utils.EnvironmentTestMixin, absltest.TestCase):
    """dm_env's tests, over more than one episode."""

    def make_object_under_test(self):
        return load_dm(TASK, subtask=0, seed=0, max_steps=6)

    def make_action_sequence(self):
        rng = np.random.default_rng(0)
        for _ in range(20):
            yield rng.uniform(-1, 1, 9)


def test_the_whole_task_can_be_loaded():
    env = load_dm(TASK, seed=0)
    step = env.reset()
    assert step.observation["observation"].shape == (72,) and step.observation["subtask"] == 0


def test_a_time_limit_truncates_with_discount_one():
    env = load_dm(TASK, subtask=1, seed=0, max_steps=3)
    steps = [env.reset(), *(env.step(np.zeros(9)) for _ in range(4))]
    kinds = [step.step_type for step in steps]
    first, mid, last = dm_env.StepType.FIRST, dm_env.StepType.MID, dm_env.StepType.LAST
    assert kinds == [first, mid, mid, last, first]
    assert steps[3].discount == 1.0 and not env.success


def test_a_success_ends_an_episode_with_discount_zero():
    env = load_dm(TASK, subtask=0, seed=0)
    expert, step = env.world.expert(), env.reset()
    while not step.last():
        assert step.discount in (None, 1.0)
        step = env.step(expert.act(env.world.state).squeeze(0).numpy())
    assert env.success and step.discount == 0.0


def test_the_same_seed_gives_the_same_episode():
    actions = np.random.default_rng(0).uniform(-1, 1, (5, 9))
    runs = [
        [env.reset(), *(env.step(a) for a in actions)]
        for env in (load_dm(TASK, 0, seed=7), load_dm(TASK, 0, seed=7))
    ]
    for one, other in zip(*runs, strict=True):
        np.testing.assert_array_equal(one.observation["observation"], other.observation["observation"])
        assert one.reward == other.reward
    different = load_dm(TASK, 0, seed=8).reset()
    assert (different.observation["observation"] != runs[0][0].observation["observation"]).any()


def test_steps_are_the_same_bits_as_in_the_batch():
    """Rows of a batch that has been running, with a weld active, against one simulation each."""
    batch = BatchedEnvironment(TASK, num_sims=3, subtask=1, nthread=2, seed=3)
    batch.reset()
    expert = batch.expert()
    for _ in range(12):
        batch.step(expert.act(batch.state))
    snapshot = batch.snapshot()
    actions = torch.rand(20, 3, 9, dtype=torch.float64, generator=torch.Generator().manual_seed(0)) * 2 - 1
    batch.reset_to(snapshot)
    expected = []
    for action in actions:
        batch.step(action)
        expected.append((batch.observation().clone(), batch.task.get_reward(batch.state).clone()))
    for row in range(3):
        env = load_dm(TASK, subtask=1, seed=0)
        env.reset_to(snapshot[row : row + 1])
        for action, (observation, reward) in zip(actions, expected, strict=True):
            step = env.step(action[row].numpy())
            np.testing.assert_array_equal(step.observation["observation"], observation[row].numpy())
            assert step.reward == float(reward[row])


def test_observations_are_not_views_of_the_simulation():
    env = load_dm(TASK, subtask=0, seed=0)
    first = env.reset().observation["observation"]
    kept = first.copy()
    env.step(np.ones(9))
    np.testing.assert_array_equal(first, kept)


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: load_dm("table_lak"), "no furniture is called 'table_lak': did you mean 'table_lack'"),
        (lambda: load_dm(TASK, subtask=4), r"in 0..3, got 4"),
        (
            lambda: load_dm(TASK, gripper="soft"),
            "setting gripper must be one of sign, continuous; got 'soft'",
        ),
    ],
)
def test_mistakes_when_loading_are_told(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_a_keyword_that_is_no_setting_is_a_type_error():
    with pytest.raises(TypeError, match="unexpected keyword argument 'velocity_scal'.*mean 'velocity_scale'"):
        load_dm(TASK, velocity_scal=0.4)


def test_mistakes_when_stepping_are_told():
    env = load_dm(TASK, subtask=0, seed=0)
    env.reset()
    with pytest.raises(ValueError, match=r"shape \(9,\) here: .*; got \(8,\)"):
        env.step(np.zeros(8))
    with pytest.raises(ValueError, match="NaN"):
        env.step(np.full(9, np.nan))


@pytest.mark.parametrize("again", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_goes_on_from_the_same_state(again):
    """To the bit, as two simulations do that are restored from one snapshot; then both draw the same next start."""
    env = load_dm(TASK, 1, seed=2, max_steps=5)
    env.reset()
    env.step(np.full(9, 0.5))
    twin = again(env)
    env.world.restore(env.snapshot())
    for _ in range(6):
        one, other = env.step(np.full(9, -0.4)), twin.step(np.full(9, -0.4))
        assert one.step_type == other.step_type and one.reward == other.reward
        np.testing.assert_array_equal(one.observation["observation"], other.observation["observation"])
    twin.step(np.ones(9))
    assert (twin.physics.data.qpos != env.physics.data.qpos).any()


def test_a_copy_leaves_the_original_s_random_state_where_it_is():
    env = load_dm(TASK, 1, seed=2)
    env.task._random = np.random.RandomState(3)
    env.reset()
    before = env.task._random.get_state()[2]
    twins = copy.copy(env), copy.deepcopy(env)
    assert [each.task._random.get_state()[2] for each in (env, *twins)] == [before] * 3
    assert len({id(each.task._random) for each in (env, *twins)}) == 3
    twins[0].task._random.randint(9)
    assert env.task._random.get_state()[2] == before


def test_what_mujoco_gave_up_on_between_steps_ends_the_episode():
    env = load_dm(TASK, 0, seed=2)
    env.reset()
    env.physics.data.qvel[0] = 1e12
    env.physics.step()
    assert env.physics.failed and not env.step(np.zeros(9)).first()
    assert env.world.failures == 1 and env._reset_next_step
    assert env.step(np.zeros(9)).first() and not env.physics.failed
    assert env.step(np.zeros(9)).mid() and env.world.failures == 1
    env.physics.data.qvel[0] = 1e12
    env.physics.step()
    env.reset_to(load_dm_snapshot())
    assert env.step(np.zeros(9)).mid() and env.world.failures == 1


def load_dm_snapshot():
    env = load_dm(TASK, 0, seed=3)
    env.reset()
    return env.snapshot()


def test_what_is_written_into_the_data_is_seen_at_once():
    env = load_dm(TASK, 0, seed=2)
    env.reset()
    env.physics.data.qpos[11] += 0.3  # of the first part, z
    assert env.world.qpos_of(env.snapshot())[0].tolist() == env.physics.data.qpos.tolist()
    height = env.physics.data.qpos[11]
    assert float(env.world.physics.qpos[0, 11]) == height
    env.physics.set_control(np.full(9, 0.01))
    assert (env.physics.control() == 0.01).all() and (env.world.physics.ctrl == 0.01).all()
    env.step(np.zeros(9))
    assert abs(env.physics.data.qpos[11] - height) < 0.1  # it falls from there


def test_an_action_counts_and_not_what_was_written_into_the_controls_before():
    env, twin = (load_dm(TASK, 0, seed=2) for _ in range(2))
    for each in (env, twin):
        each.reset()
    env.physics.data.ctrl[:7] = 0.5
    one, other = env.step(np.zeros(9)), twin.step(np.zeros(9))
    np.testing.assert_array_equal(one.observation["observation"], other.observation["observation"])


def test_a_reset_of_the_physics_ends_with_current_poses():
    physics = load_dm(TASK, 0, seed=2).physics
    with physics.reset_context():
        physics.data.qpos[11] = 0.9
    assert physics.data.xpos[:, 2].max() >= 0.9


def test_a_keyframe_that_there_is_not_is_told():
    with pytest.raises(ValueError, match="no keyframes: keyframe_id must be None, got 7"):
        load_dm(TASK, 0, seed=2).physics.reset(keyframe_id=7)


@pytest.mark.parametrize("share_model", [False, True])
def test_a_copy_of_the_physics_undoes_all_welds_and_leaves_the_original_s(share_model):
    env = load_dm(TASK, 2, seed=2, preassembled="jitter")
    compiled = env.world.physics.compiled_welds.clone()
    env.reset()
    welds = env.physics.view.eq_data.clone()
    copied = env.physics.copy(share_model)
    assert (copied.view.eq_data != compiled).any()
    copied.reset()
    assert (copied.view.eq_data == compiled).all()
    assert torch.equal(env.physics.view.eq_data, welds)


@pytest.mark.parametrize("seed", [-1, 1.5, "3", True, 2**64])
def test_a_seed_is_a_whole_number(seed):
    with pytest.raises(ValueError, match="seed must be a whole number from 0 to 18446744073709551615, got"):
        load_dm(TASK, 0, seed=seed)
    assert load_dm(TASK, 0, seed=np.int64(3)) is not None
