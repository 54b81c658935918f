"""Tools of TorchRL, dm_control and Stable-Baselines3 on the fronts, unchanged."""

import warnings

import gymnasium
import numpy as np
import pytest
import torch
from dm_control.suite.wrappers import action_scale, pixels
from torchrl.envs import DMControlWrapper, GymEnv, GymWrapper, check_env_specs

import tstar_envs
from tstar_envs import rendering

ID, TASK = "tstar/TableLack-v0", "table_lack"
MOVES = np.random.default_rng(0).uniform(-1, 1, (6, 9))


def dm(**settings):
    return tstar_envs.load_dm(TASK, subtask=0, seed=0, **settings)


@pytest.mark.parametrize(
    "make",
    [
        lambda: GymEnv(ID, subtask=0, max_steps=7),
        lambda: GymEnv(ID, frame_skip=2),
        lambda: DMControlWrapper(dm(max_steps=7)),
        lambda: DMControlWrapper(tstar_envs.load_dm("chair_ingolf")),
    ],
)
def test_torchrls_wrappers_pass_torchrls_check_and_take_seeds(make):
    env = make()
    check_env_specs(env)
    starts = []
    for seed in (3, 4, 3):
        env.set_seed(seed)
        starts.append(env.reset()["observation"])
    assert torch.equal(starts[0], starts[2]) and not torch.equal(starts[0], starts[1])
    assert env.rollout(9)["next", "reward"].abs().min() > 0


@pytest.mark.parametrize("mode", ["SameStep", "Disabled"])
def test_torchrls_wrapper_takes_a_vector(mode):
    """Over the ends of two episodes of four steps."""
    env = GymWrapper(gymnasium.make_vec(ID, 2, subtask=0, max_steps=4, autoreset_mode=mode))
    check_env_specs(env)
    steps = env.rollout(9, break_when_any_done=False)
    assert steps["next", "done"].squeeze(-1).sum(0).tolist() == [0, 0, 0, 2, 0, 0, 0, 2, 0]
    assert steps["next", "reward"].abs().min() > 0


def test_torchrls_wrapper_refuses_a_vector_that_resets_a_step_later():
    with pytest.raises(RuntimeError, match="one of SAME_STEP or DISABLED.*NEXT_STEP"):
        GymWrapper(gymnasium.make_vec(ID, 2, subtask=0))


def test_torchrls_wrappers_give_the_numbers_of_the_fronts():
    env, world = DMControlWrapper(dm()), tstar_envs.load(TASK, 1, 0)
    tensordict, start = env.reset(), env._env.snapshot()
    env._env.reset_to(start)
    world.reset_to(start)
    for move in torch.from_numpy(MOVES):
        assert torch.equal(tensordict["observation"], world.observation()[0])
        tensordict = env.step(tensordict.set("action", move))["next"]
        world.step(move.unsqueeze(0))
        assert tensordict["reward"].item() == world.state["reward"].item()


def test_actions_of_another_scale():
    plain, scaled = dm(), action_scale.Wrapper(dm(), minimum=-2.0, maximum=2.0)
    plain.reset(), scaled.reset()
    for move in MOVES:
        one, other = plain.step(move), scaled.step(2 * move)
        np.testing.assert_array_equal(one.observation["observation"], other.observation["observation"])
        assert one.reward == other.reward


def test_pixels_show_the_simulation():
    if rendering.backend() is None:
        pytest.skip(rendering.NOTICE)
    ours = rendering.make_renderer(dm().world.model, 60, 80)  # one that drew before is not in the way
    env = pixels.Wrapper(
        dm(), pixels_only=False, render_kwargs={"camera_id": "workplace", "height": 60, "width": 80}
    )
    first = env.reset().observation
    then = env.step(np.ones(9)).observation
    assert first["pixels"].shape == (60, 80, 3) and first["pixels"].std() > 10
    assert (first["pixels"] != then["pixels"]).any()
    picture = ours.draw(env.physics.data.qpos)
    assert np.abs(picture.astype(int) - then["pixels"]).mean() < 2  # our own renderer sees the same


def test_the_loop_of_dm_controls_viewer_runs_an_episode():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GLFW without a screen
        runtime = pytest.importorskip("dm_control.viewer.runtime")
    env, told = dm(max_steps=3), []

    def policy(step):
        told.append(step)
        return np.ones(9)

    loop = runtime.Runtime(env, policy)
    for _ in range(3):
        loop.tick(0.1, False)
    assert env.world.state["episode_step"].item() == 2 == len(told)  # the first tick starts the episode
    assert loop.get_time() == pytest.approx(env.physics.data.time)


def test_dm_controls_physics_is_the_simulation():
    """What its tools read is current, and what they write counts."""
    env = dm()
    env.reset()
    env.step(np.ones(9))
    physics, world = env.physics, env.world
    np.testing.assert_array_equal(physics.data.qpos, world.physics.qpos[0].numpy())
    np.testing.assert_array_equal(
        physics.named.data.sensordata["tip_pos"], world.physics.sensor("tip_pos")[0].numpy()
    )
    top = physics.named.data.qpos["table_top"][2].copy()
    physics.named.data.qpos["table_top"][2] = top + 0.3
    observation = env.step(np.zeros(9)).observation["observation"]
    assert physics.named.data.qpos["table_top"][2] < top + 0.3 - 0.03  # it falls
    assert physics.named.data.qpos["table_top"][2] in observation
    assert physics.timestep() * 10 == pytest.approx(env.control_timestep()) == 0.1
