"""Seeds of the Gymnasium fronts: a start comes again from its seed, the same in every front."""

import gymnasium
import numpy as np
import pytest
from test_gymnasium_vector_env import ID, make_vec

import tstar_envs
from tstar_rl.env.furniture_env import FurnitureEnv

TASK = "table_lack"


def make_vec_of_two(name, **settings):
    return gymnasium.make_vec(name, 2, "vector_entry_point", **settings)


MAKE = pytest.mark.parametrize("make", [gymnasium.make, make_vec_of_two])


@MAKE
def test_a_start_comes_again_from_gymnasiums_seed_whether_it_was_given_or_drawn(make):
    """Those that Gymnasium draws have 128 bits."""
    env, again = (make(ID, subtask=0).unwrapped for _ in range(2))
    first, second = env.reset()[0], env.reset()[0]
    np.testing.assert_array_equal(again.reset(seed=env.np_random_seed)[0], first)
    np.testing.assert_array_equal(again.reset()[0], second)
    assert not np.array_equal(first, second)
    large = again.reset(seed=2**100 + 7)[0]
    np.testing.assert_array_equal(again.reset(seed=7)[0], large)
    starts = []
    for seed in (1, 1, 2):
        env = make(ID, subtask=0).unwrapped
        env.np_random = np.random.default_rng(seed)
        starts.append(env.reset()[0])
    np.testing.assert_array_equal(starts[0], starts[1])
    assert not np.array_equal(starts[0], starts[2])


@MAKE
def test_a_reset_that_is_refused_leaves_the_episode_and_the_seed(make):
    env, other = make(ID, subtask=0).unwrapped, make(ID, subtask=1).unwrapped
    env.reset(seed=3)
    other.reset(seed=0)
    with pytest.raises(gymnasium.error.Error):
        env.reset(seed=-1)
    with pytest.raises(ValueError, match="subtask"):
        env.reset(seed=9, options={"snapshot": other.snapshot()})
    assert env.np_random_seed == 3
    env.step(env.action_space.sample())


def test_a_seed_gives_the_same_start_in_every_front():
    env = gymnasium.make(ID, subtask=0)
    first, other, again = env.reset(seed=7)[0], env.reset()[0], env.reset(seed=7)[0]
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
    dm = tstar_envs.load_dm(TASK, subtask=0, seed=7).reset().observation["observation"]
    np.testing.assert_array_equal(first, dm.astype(np.float32))
    rows = FurnitureEnv(TASK, num_envs=2, subtask=0, seed=7).reset()["observation"].numpy()
    np.testing.assert_array_equal(make_vec(subtask=0).reset(seed=7)[0], rows)
