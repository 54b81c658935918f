"""Stable-Baselines3 on the batched simulator: what it gets is what its own vector of single environments gives it."""

import gymnasium
import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

from tstar_envs.stable_baselines_env import StableBaselinesEnv

ID = "tstar/TableLack-v0"
SETTINGS = {"subtask": 0, "max_steps": 4, "reward_scale": 0.05}


def actions(num_envs, steps=10):
    return np.random.default_rng(0).uniform(-1, 1, (steps, num_envs, 9)).astype(np.float32)


def test_it_gives_what_a_vector_of_single_environments_gives():
    """Of one row, since a vector has one generator; over the ends of two episodes."""
    ours = StableBaselinesEnv("table_lack", 1, **SETTINGS)
    theirs = DummyVecEnv([lambda: gymnasium.make(ID, **SETTINGS)])
    for env in (ours, theirs):
        env.seed(3)
    np.testing.assert_array_equal(ours.reset(), theirs.reset())
    assert ours.reset_infos == theirs.reset_infos
    ends = 0
    for action in actions(1):
        mine, other = ours.step(action), theirs.step(action)
        for a, b in zip(mine[:3], other[:3], strict=True):
            np.testing.assert_array_equal(a, b)
            assert a.dtype == b.dtype
        got, expected = mine[3][0], other[3][0]
        if mine[2][0]:
            ends += 1
            np.testing.assert_array_equal(
                got.pop("terminal_observation"), expected.pop("terminal_observation")
            )
            assert got.pop("is_success") is False
        assert {"TimeLimit.truncated": False, **got} == expected
    assert ends == 2


def test_a_success_ends_an_episode_and_is_told():
    env = StableBaselinesEnv("table_lack", 2, subtask=0, max_steps=200)
    env.seed(0)
    env.reset()
    world = env.envs.world
    expert = world.expert()
    told = []
    for _ in range(150):
        _, _, ended, infos = env.step(expert.act(world.state).numpy())
        told += [infos[row] for row in ended.nonzero()[0]]
        if told:
            break
    assert told[0]["is_success"] and not told[0]["TimeLimit.truncated"]


def test_a_seed_gives_the_same_rows_again_and_counts_once():
    env = StableBaselinesEnv("table_lack", 3, **SETTINGS)
    env.seed(1)
    first, second = env.reset(), env.reset()
    env.seed(1)
    np.testing.assert_array_equal(env.reset(), first)
    np.testing.assert_array_equal(env.reset(), second)
    assert not np.array_equal(first, second)
    assert not np.array_equal(first[0], first[1])


def test_a_snapshot_is_an_option_of_all_rows():
    env = StableBaselinesEnv("table_lack", 2, **SETTINGS)
    env.reset()
    env.step(actions(2)[0])
    snapshot = env.envs.snapshot()
    env.set_options({"snapshot": snapshot})
    restored = env.reset()
    assert not np.array_equal(env.reset(), restored)  # options count once
    env.set_options({"snapshot": snapshot})
    np.testing.assert_array_equal(env.reset(), restored)
    np.testing.assert_array_equal(restored, env.envs.world.observation().float().numpy())
    assert (env.envs.snapshot()["physics"] == snapshot["physics"]).all()
    with pytest.raises(ValueError, match=r"one dict for all simulations.*batch \[2\]; got a list"):
        env.set_options([{}, {}])


def test_what_is_of_rows_alone_is_refused():
    env = StableBaselinesEnv("table_lack", 2, **SETTINGS)
    assert env.get_attr("reward_scale", [1]) == [0.05]
    env.set_attr("reward_scale", 0.1)
    assert env.get_attr("reward_scale") == [0.1, 0.1]
    with pytest.raises(ValueError, match="one object"):
        env.set_attr("reward_scale", 1.0, indices=0)
    with pytest.raises(NotImplementedError, match=r"envs\.snapshot\(\)"):
        env.env_method("snapshot")


def test_a_mistake_in_a_setting_is_told():
    with pytest.raises(TypeError, match=r"^StableBaselinesEnv\(\) got an unexpected .*'velocity_scal'"):
        StableBaselinesEnv("table_lack", 2, velocity_scal=0.4)


def test_a_recorder_knows_how_fast_control_is():
    """`VecVideoRecorder` reads it there, and takes 30 images a second where there is nothing."""
    env = StableBaselinesEnv("table_lack", 2, render_mode="rgb_array", width=80, height=60, **SETTINGS)
    assert (env.envs._camera.width, env.envs._camera.height) == (80, 60)
    assert env.metadata["render_fps"] == 10 and "rgb_array" in env.metadata["render_modes"]


def test_where_nothing_can_be_drawn_there_is_no_picture(monkeypatch):
    env = StableBaselinesEnv("table_lack", 2, render_mode="rgb_array", width=80, height=60, **SETTINGS)
    env.reset()
    monkeypatch.setattr("tstar_envs.stable_baselines_env.backend", lambda: None)
    monkeypatch.setattr(env.envs, "render", lambda: None)
    assert env.render() is None


def test_ppo_runs_on_it_and_its_monitor_knows_episodes():
    env = VecMonitor(StableBaselinesEnv("table_lack", 2, **SETTINGS))
    model = PPO("MlpPolicy", env, n_steps=16, batch_size=32, n_epochs=1, seed=0, device="cpu")
    assert model.learn(32).num_timesteps == 32
    assert model.ep_info_buffer is not None
    assert {episode["l"] for episode in model.ep_info_buffer} == {4}
    assert list(model.ep_success_buffer or []) == [False] * 8


@pytest.mark.slow
@pytest.mark.parametrize(
    "make",
    [
        lambda n, **settings: VecMonitor(StableBaselinesEnv("table_lack", n, **settings)),
        lambda n, **settings: make_vec_env(ID, n, env_kwargs=settings),
    ],
    ids=["batched", "single"],
)
def test_ppo_learns_to_reach(make):
    """4096 steps of the first 20 control steps of a subtask: enough to move above the part."""
    settings = SETTINGS | {"max_steps": 20}
    training, fresh = make(4, **settings), make(1, **settings)
    training.seed(4)
    fresh.seed(1)
    model = PPO("MlpPolicy", training, n_steps=128, learning_rate=1e-3, gamma=0.95, seed=0, device="cpu")
    before, _ = evaluate_policy(model, fresh, n_eval_episodes=5)
    model.learn(4096)
    after, _ = evaluate_policy(model, fresh, n_eval_episodes=5)
    assert model.num_timesteps == 4096
    assert after > before + 5, f"return {before} before, {after} after"
