"""Many environments in one Gymnasium vector: its autoreset modes, what it does with a row that it resets."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AutoresetMode

import tstar_envs  # noqa: F401  registers the ids
from tstar_envs.gymnasium_vector_env import GymnasiumVectorEnv
from tstar_envs.scene import SUBSTEPS

ID = "tstar/TableLack-v0"
STILL = {"part_noise": 0.0, "part_noise_degrees": 0.0, "arm_noise": 0.0}


def make_vec(num_envs=2, **settings):
    return gymnasium.make_vec(ID, num_envs, "vector_entry_point", **settings)


def actions(*shape, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, shape).astype(np.float32)


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_a_vector_does_what_gymnasiums_own_does(mode):
    """Against `SyncVectorEnv` in the same mode; without noise all episodes begin alike, so they compare to the bit.

    A reset by mask in step 2 makes the rows end at different times.
    """
    settings = {"subtask": 1, "max_steps": 4, **STILL}
    ours = make_vec(autoreset_mode=mode, **settings)
    theirs = gymnasium.make_vec(ID, 2, "sync", {"autoreset_mode": mode}, **settings)
    assert ours.metadata["autoreset_mode"] is theirs.metadata["autoreset_mode"] is mode
    assert ours.observation_space == theirs.observation_space and ours.action_space == theirs.action_space
    assert_same(ours.reset(seed=0), theirs.reset(seed=0))
    ended, seen = np.zeros(2, dtype=bool), set()
    for i, action in enumerate(actions(14, 2, 9)):
        again = np.array([True, False]) if i == 2 else ended
        if i == 2 or (mode is AutoresetMode.DISABLED and ended.any()):
            assert_same(*(env.reset(options={"reset_mask": again}) for env in (ours, theirs)))
        one, other = ours.step(action), theirs.step(action)
        assert_same(one, other)
        ended = one[2] | one[3]
        seen.add(tuple(ended.tolist()))
    assert seen == {(False, False), (True, False), (False, True)}


def assert_same(ours, theirs):
    """Everything a reset or a step returns, dtypes and keys too."""
    for one, other in zip(ours, theirs, strict=True):
        assert data_equivalence(one, other, exact=True), f"{one} is not {other}"


def test_a_mode_that_there_is_not_is_told_with_those_that_there_are():
    with pytest.raises(
        ValueError, match="must be one of 'NextStep', 'SameStep', 'Disabled'; got 'same_step'"
    ):
        make_vec(autoreset_mode="same_step")


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_a_row_that_was_never_reset_does_not_step(mode):
    env = make_vec(subtask=0, autoreset_mode=mode)
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"in simulations \[0, 1\]"):
        env.step(np.zeros((2, 9)))
    env.reset(seed=0, options={"reset_mask": np.array([True, False])})
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"in simulations \[1\]"):
        env.step(np.zeros((2, 9)))
    env.reset(options={"reset_mask": np.array([False, True])})
    env.step(np.zeros((2, 9)))


def test_a_step_steps_no_row_that_it_resets():
    """What would fail there is not counted: that episode is over."""
    env = make_vec(subtask=0, max_steps=3)
    env.reset(seed=0)
    world = env.world
    env.step(np.zeros((2, 9)))
    env.reset(options={"reset_mask": np.array([False, True])})
    while not env.step(np.zeros((2, 9)))[3][0]:
        pass
    step = world.physics.step

    def fails_in_the_first(substeps, mask=None):
        failed = step(substeps, mask)
        if substeps == SUBSTEPS:  # no parts that settle
            failed[0] |= mask is None or bool(mask[0])
        return failed

    world.physics.step = fails_in_the_first
    _, rewards, *ends, infos = env.step(np.zeros((2, 9)))
    assert world.failures == 0 and rewards[0] == 0 and rewards[1] != 0 and not np.stack(ends)[:, 0].any()
    assert world.state["episode_step"].tolist() == [0, 3] and infos["_success"].all()


def test_a_step_ignores_the_action_of_a_row_that_it_resets():
    env = make_vec(subtask=0, max_steps=1)
    env.reset(seed=0)
    assert env.step(np.zeros((2, 9)))[3].all()
    _, rewards, terminated, truncated, _ = env.step(np.full((2, 9), np.nan))
    assert not rewards.any() and not terminated.any() and not truncated.any()


def test_a_picture_after_closing_is_drawn_anew_and_closed_again():
    envs = GymnasiumVectorEnv("table_lack", 1, 0, render_mode="rgb_array", width=16, height=16)
    envs.reset(seed=0)
    for _ in range(2):
        drawn = envs.render()
        assert (envs._camera._renderer is not None) is (drawn is not None)
        envs.close()
        assert envs._camera._renderer is None


def test_keywords_of_vectors_with_processes_close_it():
    envs = make_vec(subtask=0)
    envs.close(terminate=True)
    assert envs.closed
