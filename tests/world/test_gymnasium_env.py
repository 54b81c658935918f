"""The Gymnasium front: Gymnasium's own contract, the same numbers as the other fronts."""

import warnings

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env
from tensordict import TensorDict
from test_gymnasium_vector_env import ID, actions, make_vec
from worlds import PIECES

import tstar_envs
from tstar_envs import rendering
from tstar_envs.furniture import library, names
from tstar_envs.gymnasium_env import environment_id, register
from tstar_rl.env.furniture_env import FurnitureEnv

TASK = "table_lack"


@pytest.fixture(scope="module")
def snapshot():
    """Three simulations in the middle of subtask 1, a weld active, actions as a policy would take them."""
    env = FurnitureEnv(TASK, num_envs=3, subtask=1, nthread=2, seed=3)
    env.rollout(12, env.expert())
    return env.snapshot()


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name not in PIECES)) for name in names()]
)
def test_every_piece_of_furniture_passes_gymnasiums_check_without_a_warning(name):
    blind = rendering.backend() is None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for arguments in ({"subtask": 0}, {"max_steps": 5}):
            check_env(gymnasium.make(environment_id(name), **arguments).unwrapped, skip_render_check=blind)


def test_ids_are_made_from_names_and_an_import_is_enough():
    assert environment_id(TASK) == ID and environment_id("chair_ingolf") == "tstar/ChairIngolf-v0"
    assert gymnasium.make("tstar_envs:" + ID, subtask=2).unwrapped.world.subtask == 2
    before = gymnasium.registry[ID]
    tstar_envs.register()
    assert gymnasium.registry[ID] is before


def test_two_names_of_one_id_are_told(monkeypatch):
    assert environment_id("stool_1") == environment_id("stool1")
    monkeypatch.setattr("tstar_envs.gymnasium_env.library.names", lambda: ("stool1", "stool_1"))
    with pytest.warns(
        UserWarning, match="'stool_1' and 'stool1' have the same id, tstar/Stool1-v0, which st"
    ):
        register()
    assert gymnasium.registry["tstar/Stool1-v0"].kwargs == {"task": "stool1"}
    del gymnasium.registry["tstar/Stool1-v0"]


def test_a_folder_of_furniture_that_is_none_is_told_and_the_packages_own_have_their_ids(
    monkeypatch, tmp_path
):
    monkeypatch.setenv("TSTAR_FURNITURE", str(tmp_path / "nowhere"))
    known = gymnasium.registry.pop(ID)
    with pytest.warns(UserWarning, match="own furniture alone: TSTAR_FURNITURE names .*nowhere, which is no"):
        register()
    assert gymnasium.registry[ID].kwargs == known.kwargs
    library._load.cache_clear()
    assert gymnasium.make(ID, subtask=0).unwrapped.world.name == TASK
    with pytest.raises(ValueError, match="TSTAR_FURNITURE names .*nowhere, which is no folder"):
        library.load("of_mine")


def test_quaternions_and_phase_are_bounded_where_they_stand_in_the_observation():
    env = gymnasium.make(ID, subtask=0)
    observation, info = env.reset(seed=0)
    high, low = env.observation_space.high, env.observation_space.low
    assert observation.dtype == np.float32 and observation.shape == high.shape == (72,)
    quaternions = observation[(high == 1) & (low == -1)].reshape(-1, 4)
    np.testing.assert_allclose(np.linalg.norm(quaternions, axis=1), 1, rtol=1e-6)
    assert (
        quaternions.shape == (6, 4)
        and (observation[(high == 1) & (low == 0)] == np.eye(8)[info["phase"]]).all()
    )


def test_the_task_truncates_by_itself_and_asks_for_a_reset():
    env = gymnasium.make(ID, subtask=1, max_steps=3)
    env.reset(seed=0)
    ends = [env.step(np.zeros(9))[2:4] for _ in range(3)]
    assert ends == [(False, False), (False, False), (False, True)]
    with pytest.raises(gymnasium.error.ResetNeeded, match="call reset"):
        env.step(np.zeros(9))


def test_the_same_numbers_as_in_the_other_fronts(snapshot):
    """Rows of one snapshot under one sequence of actions: TorchRL, dm_env, one environment, a vector of them."""
    moves = torch.from_numpy(actions(15, 3, 9))
    torchrl = FurnitureEnv(TASK, num_envs=3, subtask=1, seed=0)
    start = TensorDict({"snapshot": snapshot, "use": torch.ones(3, 1, dtype=torch.bool)}, [3])
    at = torchrl.reset(TensorDict({"start": start}, [3]))
    vector = make_vec(num_envs=3, subtask=1)
    np.testing.assert_array_equal(vector.reset(options={"snapshot": snapshot})[0], at["observation"].numpy())
    rows = [slice(i, i + 1) for i in range(3)]
    singles = [gymnasium.make(ID, subtask=1) for _ in rows]
    dms = [tstar_envs.load_dm(TASK, subtask=1) for _ in rows]
    for row, single, dm in zip(rows, singles, dms, strict=True):
        single.reset(options={"snapshot": snapshot[row]})
        dm.reset_to(snapshot[row])
    for move in moves:
        expected = torchrl.step(at.set("action", move))["next"]
        observations, rewards, terminated, truncated, infos = vector.step(move.numpy())
        np.testing.assert_array_equal(observations, expected["observation"].numpy())
        np.testing.assert_array_equal(rewards.astype(np.float32), expected["reward_env"].squeeze(-1).numpy())
        assert not terminated.any() and not truncated.any()
        for i, (single, dm) in enumerate(zip(singles, dms, strict=True)):
            step, (observation, reward, *_, info) = dm.step(move[i].numpy()), single.step(move[i].numpy())
            np.testing.assert_array_equal(observation, step.observation["observation"].astype(np.float32))
            np.testing.assert_array_equal(observation, observations[i])
            assert reward == step.reward == rewards[i]
            for name in ("subtask", "phase", "completed"):
                assert info[name] == step.observation[name] == infos[name][i] == int(expected[name][i]), name


def test_success_terminates_pays_and_is_in_the_info():
    """The expert's actions, told to a single environment and to a vector of one."""
    env, vector = gymnasium.make(ID, subtask=0, reward_scale=0.05), make_vec(num_envs=1, subtask=0)
    env.reset(seed=0)
    vector.reset(seed=0)
    world = env.unwrapped.world
    expert, total, last = world.expert(), 0.0, {"success": False, "phase": 1, "completed": 0}
    while not last["success"]:
        assert last["phase"] >= 1 and last["completed"] == 0
        action = expert.act(world.state).float().numpy()[0]
        _, reward, terminated, truncated, last = env.step(action)
        _, rewards, *ends, infos = vector.step(action[None])
        assert reward == 0.05 * rewards[0] and ends == [[terminated], [truncated]] and not truncated
        assert infos["success"][0] == last["success"] == terminated
        total += reward
    assert last == {"success": True, "subtask": 1, "phase": 1, "completed": 1}
    assert total > 0.05 * 50000  # eight bonuses of 5000, some of them doubled


def test_pictures():
    env = gymnasium.make(ID, subtask=0, render_mode="rgb_array", width=80, height=60)
    vector = make_vec(subtask=0, render_mode="rgb_array", width=80, height=60)
    for each in (env, vector):
        each.reset(seed=0)
        assert each.metadata["render_fps"] == 10
    image, images = env.render(), vector.render()
    if image is None:
        pytest.skip(rendering.NOTICE)
    assert image.shape == (60, 80, 3) and image.dtype == np.uint8 and image.std() > 10
    assert isinstance(images, tuple) and len(images) == 2 and (images[0] != images[1]).any()
    env.step(np.ones(9))
    assert (env.render() != image).any()
    for each in (env, vector):
        each.close()


@pytest.mark.parametrize(
    "arguments, message",
    [
        ({"subtask": 4}, r"subtask of table_lack must be None \(the whole task\) or in 0..3, got 4"),
        ({"render_mode": "ansi"}, "render_mode must be one of None, 'rgb_array'; got 'ansi'"),
        ({"reward_scale": float("nan")}, "reward_scale must be a finite number, got nan"),
        ({"reward_scale": "0.05"}, "reward_scale must be a finite number, got '0.05'"),
        ({"width": -3}, "width must be a whole number from 1 to 1280, got -3"),
        ({"width": 5000}, "width must be a whole number from 1 to 1280, got 5000"),
        ({"height": 961}, "height must be a whole number from 1 to 960, got 961"),
        ({"height": 60.0}, "height must be a whole number from 1 to 960, got 60.0"),
        ({"nthread": -1}, "nthread .* must be a whole number from 0, got -1"),
        ({"autoreset_mode": "Later"}, "autoreset_mode must be one of 'NextStep', .*; got 'Later'"),
    ],
)
def test_mistakes_when_making_are_told(arguments, message):
    with pytest.raises(ValueError, match=message):
        gymnasium.make_vec(ID, 2, **arguments)


@pytest.mark.parametrize(
    "make", [lambda **k: gymnasium.make(ID, **k), lambda **k: gymnasium.make_vec(ID, 2, **k)]
)
def test_a_keyword_that_is_no_setting_is_a_type_error(make):
    with pytest.raises(TypeError, match="unexpected keyword argument 'velocity_scal'.*mean 'velocity_scale'"):
        make(velocity_scal=0.4)
    with pytest.raises(
        TypeError, match="unexpected keyword argument 'frameskip'; valid settings: velocity_scale"
    ):
        make(frameskip=2)


@pytest.mark.parametrize("arguments", [{"reward_scale": float("inf")}, {"width": 0}, {"height": -3}])
def test_the_single_environment_tells_them_too(arguments):
    with pytest.raises(ValueError, match=f"{next(iter(arguments))} must be"):
        gymnasium.make(ID, **arguments)


@pytest.mark.parametrize("number", [0, 2.0])
def test_so_many_simulations_cannot_be(number):
    with pytest.raises(ValueError, match=f"must be a whole number from 1, got {number}"):
        gymnasium.make_vec(ID, number)


def test_mistakes_when_resetting_are_told(snapshot):
    env, vector = gymnasium.make(ID, subtask=0), make_vec(subtask=1)
    for make, options, message in (
        (env, {"snapshots": snapshot}, "unknown reset option 'snapshots'; valid options: snapshot$"),
        (
            env,
            {"snapshot": {}},
            "'snapshot' is what an environment's snapshot.. returns, of batch .1,. here; got dict",
        ),
        (env, {"snapshot": snapshot[:1]}, "subtask 0 of table_lack cannot start from snapshots of subtask 1"),
        (vector, {"snapshot": snapshot}, r"of batch \(2,\) here; got batch \(3,\)"),
        (vector, {"reset_mask": [True]}, r"shape \(2,\) and type bool.*got bool of shape \(1,\)"),
        (vector, {"reset_mask": np.zeros(2, dtype=bool)}, "got False everywhere"),
        (env, [1], r"reset options are a mapping of snapshot; got \[1\]"),
        (vector, 5, "reset options are a mapping of snapshot, reset_mask; got 5"),
    ):
        with pytest.raises(ValueError, match=message):
            make.reset(options=options)


def test_a_snapshot_that_is_refused_leaves_the_episode_that_is_under_way(snapshot):
    for env, refused, shape in (
        (gymnasium.make(ID, subtask=0), snapshot[:1], (9,)),
        (make_vec(subtask=0), snapshot[:2], (2, 9)),
    ):
        env.reset(seed=3)
        drawn = env.unwrapped.world.generator.get_state()
        with pytest.raises(ValueError, match="cannot start from snapshots of subtask 1"):
            env.reset(seed=4, options={"snapshot": refused})
        assert env.unwrapped.world.generator.get_state().equal(drawn)
        env.step(np.zeros(shape))


def test_mistakes_when_stepping_are_told():
    env, vector = gymnasium.make(ID, subtask=0), make_vec(subtask=0)
    for each, shape in ((env, (9,)), (vector, (2, 9))):
        with pytest.raises(gymnasium.error.ResetNeeded):
            each.step(np.zeros(shape))
        each.reset(seed=0)
        with pytest.raises(ValueError, match=r"9,?\) here: 7 joint velocities, gripper, connect; got \(8,\)"):
            each.step(np.zeros(8))
        with pytest.raises(ValueError, match="NaN in simulations"):
            each.step(np.full(shape, np.nan))
