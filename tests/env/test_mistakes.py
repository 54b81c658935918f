"""What a user is told who makes a mistake: what was got, what is valid. Files' own mistakes are tested beside them."""

import copy
import inspect
import pickle

import pytest
import torch
from hydra import compose, initialize_config_dir
from hydra.errors import ConfigCompositionException, MissingConfigException
from tensordict import TensorDict

from tstar_rl.config.build import environment
from tstar_rl.config.values import CONFIGS, settings
from tstar_rl.env.furniture_env import FurnitureEnv
from tstar_rl.updates import PPOSettings

TASK = "table_lack"


def config(*overrides: str, recipe: str = "gail_ppo"):
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        return compose(f"recipe/{recipe}", list(overrides))


@pytest.fixture(scope="module")
def env():
    env = FurnitureEnv(TASK, num_envs=2, subtask=0, seed=0)
    env.reset()
    return env


@pytest.mark.parametrize(
    "arguments, message",
    [
        ({"task": "table_lak"}, "no furniture is called 'table_lak': did you mean 'table_lack'"),
        ({"subtask": 4}, r"subtask of table_lack must be None \(the whole task\) or in 0..3, got 4"),
        ({"num_envs": 0}, "number of simulations must be a whole number from 1, got 0"),
        ({"num_envs": 2.0}, "number of simulations must be a whole number from 1, got 2.0"),
        ({"num_envs": True}, "number of simulations must be a whole number from 1, got True"),
        ({"nthread": -1}, r"nthread \(0: all cores\) must be a whole number from 0, got -1"),
        ({"skipped_phases": "half"}, "skipped_phases must be one of paid, unpaid; got 'half'"),
        ({"device": "mps"}, "device 'cpu' or 'cuda', got 'mps'"),
        ({"device": None}, "device 'cpu' or 'cuda', got 'None'"),
        ({"device": "cuda", "physics": "mujoco"}, "physics 'mujoco' runs on device 'cpu'"),
        ({"device": "gpu"}, "simulations run on device .cpu. or .cuda., got .gpu."),
        ({"physics": "isaac"}, "physics must be one of mujoco, warp or None, got 'isaac'"),
        ({"velocity_scale": 2.0}, r"velocity_scale must be in \(0, 1\], got 2.0"),
        ({"gripper": "soft"}, "gripper must be one of sign, continuous; got 'soft'"),
        ({"max_steps": 0}, "max_steps must be at least 1, got 0"),
    ],
)
def test_an_environment_that_cannot_be(arguments, message):
    with pytest.raises(ValueError, match=message):
        FurnitureEnv(**{"task": TASK, **arguments})


def test_a_keyword_that_is_no_setting():
    said = "unexpected keyword argument 'velocity_scal'.*did you mean 'velocity_scale'.*valid settings: .*gripper"
    with pytest.raises(TypeError, match=said):
        FurnitureEnv(TASK, velocity_scal=0.4)


def test_an_action_of_another_shape(env):
    tensordict = env.reset()
    with pytest.raises(ValueError, match=r"shape \(2, 9\).*gripper, connect.*got \(2, 8\)"):
        env.step(tensordict.set("action", torch.zeros(2, 8)))


def test_what_is_no_snapshot(env):
    odd, told = (
        env.reset().select("observation"),
        "a snapshot has physics, welds and task, .*; this has observation",
    )
    for edit in (env.qpos_of, lambda snapshot: env.with_qpos(snapshot, torch.zeros(2, 44))):
        with pytest.raises(ValueError, match=told):
            edit(odd)


@pytest.mark.parametrize("rows", [(slice(1),), (slice(None), slice(-1))], ids=["a row too few", "short rows"])
def test_positions_of_another_shape(env, rows):
    snapshot = env.snapshot()
    qpos = env.qpos_of(snapshot)[rows]
    with pytest.raises(
        ValueError, match=r"positions of 2 snapshots have shape \(2, 44\), got \([12], 4[34]\)"
    ):
        env.with_qpos(snapshot, qpos)


@pytest.mark.parametrize("noise", [-1, float("nan"), float("inf"), 10**400, "a", None])
def test_noise_of_the_expert_that_cannot_be(env, noise):
    with pytest.raises(
        ValueError, match=f"noise of the expert must be a finite number.*, got '?{str(noise)[:20]}"
    ):
        env.expert(noise)


@pytest.mark.parametrize("subtask", [-1, 4, 9, None])
def test_features_of_a_subtask_that_is_not_there(env, subtask):
    with pytest.raises(ValueError, match=rf"subtask of table_lack must be in 0..3, got {subtask}"):
        env.geometry(subtask)


def test_an_action_with_nan_names_the_simulation(env):
    action = torch.zeros(2, 9)
    action[1, 3] = torch.nan
    with pytest.raises(ValueError, match=r"NaN in simulations \[1\]"):
        env.step(env.reset().set("action", action))


def test_actions_out_of_range_are_clipped(env):
    snapshot = env.snapshot()
    outs = []
    for size in (1.0, 7.0):
        env.restore(snapshot)
        tensordict = env.reset(_start(snapshot))
        outs.append(env.step(tensordict.set("action", size * torch.ones(2, 9)))["next", "observation"])
    torch.testing.assert_close(*outs, rtol=0, atol=0)


def _start(snapshot):
    return TensorDict({"start": {"snapshot": snapshot, "use": torch.ones(2, 1, dtype=torch.bool)}}, [2])


def test_an_injected_start_of_another_subtask(env):
    other = FurnitureEnv(TASK, num_envs=2, subtask=1, seed=0)
    other.reset()
    with pytest.raises(ValueError, match="episodes of subtask 0 of table_lack cannot start.*of subtask 1"):
        env.reset(_start(other.snapshot()))


def test_an_unknown_config_key():
    with pytest.raises(ConfigCompositionException, match="'sede'"):
        config("sede=1")
    with pytest.raises(ConfigCompositionException, match="'ppo.learning_rat'"):
        config("ppo.learning_rat=1")


def test_an_unknown_config_key_that_is_forced_in():
    with pytest.raises(ValueError, match="PPOSettings has no learning_rat; it has .*learning_rate"):
        settings(PPOSettings, config("+ppo.learning_rat=1").ppo)
    with pytest.raises(TypeError, match="unexpected keyword argument 'velocity_scal'.*'velocity_scale'"):
        environment(config("+env.velocity_scal=1"), 0, 1, 0)


def test_an_unknown_task_or_scale():
    with pytest.raises(MissingConfigException, match=r"(?s)task/table_lak.*table_lack"):
        config("task=table_lak")
    with pytest.raises(MissingConfigException, match=r"(?s)scale/huge.*laptop.*paper"):
        config("scale=huge")


def test_a_batch_of_simulations_is_not_copied_and_it_is_told_what_to_do(env):
    for copied in (copy.deepcopy, pickle.dumps):
        with pytest.raises(
            TypeError, match=r"make an environment of the same arguments, .* restore\(snapshot\)"
        ):
            copied(env)


def test_help_says_what_an_environment_is_made_with():
    said = str(inspect.signature(FurnitureEnv))
    assert said.startswith("(task: 'str', num_envs: 'int' = 1, subtask") and said.endswith(
        "**settings: 'Any')"
    )
