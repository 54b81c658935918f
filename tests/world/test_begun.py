"""Simulations in which no episode was begun are not stepped; masks and subtasks are checked as they are given."""

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode

import tstar_envs
from tstar_envs.environment import BatchedEnvironment
from tstar_envs.furniture import FurnitureError, library
from tstar_envs.gymnasium_env import GymnasiumEnv
from tstar_envs.gymnasium_vector_env import GymnasiumVectorEnv
from tstar_envs.tasks.begun import Begun
from tstar_envs.tasks.episode_start import TRIES, StartError

REST = torch.zeros(2, 9)


def test_a_step_before_a_reset_is_refused():
    world = BatchedEnvironment("table_lack", 2, 2, nthread=1, seed=0)
    with pytest.raises(
        ValueError, match=r"no episode of table_lack was begun in simulation 0: call reset\(\) first"
    ):
        world.step(REST)
    world.reset(torch.tensor([True, False]))
    with pytest.raises(ValueError, match="begun in simulation 1"):
        world.step(REST)
    world.step(REST, torch.tensor([True, False]))
    assert world.state["subtask"].tolist() == [2, 0]
    snapshot = world.snapshot()
    world.reset()
    world.step(REST)
    other = BatchedEnvironment("table_lack", 2, 2, nthread=1, seed=0)
    other.restore(snapshot)  # a state is an episode that goes on, if one was begun
    other.step(REST, torch.tensor([True, False]))
    with pytest.raises(ValueError, match="begun in simulation 1"):
        other.step(REST)


def test_a_mask_that_is_used_again_changes_nothing():
    begun, mask = Begun("table_lack", torch.ones(2, dtype=torch.bool)), torch.tensor([True, False])
    begun.add(torch.ones(2, dtype=torch.bool))
    begun.remove(mask)
    mask.zero_()
    with pytest.raises(ValueError, match="begun in simulation 0"):
        begun.check(None)


def unsettled(world, monkeypatch):
    """From now on no start of the world settles."""
    monkeypatch.setattr(world.physics, "settle", lambda mask, steps: mask.clone())


def test_where_a_reset_fails_there_is_no_episode_to_step(monkeypatch):
    world = tstar_envs.load("table_lack", 2, 0, 1, 0)
    world.reset()
    with monkeypatch.context() as patch, pytest.raises(StartError):
        unsettled(world, patch)
        world.reset(torch.tensor([False, True]))
    assert world.failures == TRIES
    world.step(REST, torch.tensor([True, False]))
    with pytest.raises(ValueError, match="begun in simulation 1"):
        world.step(REST)
    world.reset(torch.tensor([False, True]))
    world.step(REST)


def test_a_snapshot_from_after_such_a_reset_is_of_no_episode(monkeypatch):
    world, other = (tstar_envs.load("table_lack", 1, None, 1, 0) for _ in range(2))
    world.reset()
    expert = world.expert()
    while not world.state["completed"].all():
        world.step(expert.act(world.state))
    with monkeypatch.context() as patch, pytest.raises(StartError):
        unsettled(world, patch)
        world.reset()
    for each in (world, other):
        each.restore(world.snapshot())
        each.step(REST[:1])
        assert each.state["failed"].all() and not each.state["completed"].any()
        with pytest.raises(ValueError, match="that one was given up"):
            each.reset_to(world.snapshot())
    world.reset()
    world.step(REST[:1])


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_nor_is_there_one_in_the_vector(mode, monkeypatch):
    envs = GymnasiumVectorEnv("table_lack", 2, 0, autoreset_mode=mode)
    envs.reset(seed=0)
    second = {"reset_mask": np.array([False, True])}
    with monkeypatch.context() as patch, pytest.raises(StartError):
        unsettled(envs.world, patch)
        envs.reset(options=second)
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"in simulations \[1\]"):
        envs.step(REST.numpy())
    envs.reset(options=second)
    envs.step(REST.numpy())


def test_what_ended_in_a_step_is_known_where_another_episode_could_not_begin(monkeypatch):
    envs = GymnasiumVectorEnv("table_lack", 2, 0, max_steps=2)
    envs.reset(seed=0)
    envs.step(REST.numpy())
    envs.reset(options={"reset_mask": np.array([False, True])})
    envs.step(REST.numpy())  # the first ends
    with monkeypatch.context() as patch, pytest.raises(StartError):
        unsettled(envs.world, patch)
        envs.step(REST.numpy())  # the second ends, the first does not begin
    envs.step(REST.numpy())
    assert envs.world.state["episode_step"].tolist() == [0, 0]


def test_dm_control_steps_no_simulation_without_an_episode():
    dm = tstar_envs.load_dm("table_lack", 0, 0)
    dm.reset()
    dm.world.restore(tstar_envs.load_dm("table_lack", 0).snapshot())
    with pytest.raises(ValueError, match="no episode of table_lack was begun"):
        dm.step(np.zeros(9))


def test_nor_is_there_one_in_the_single_environments(monkeypatch):
    env, dm = GymnasiumEnv("table_lack", 0), tstar_envs.load_dm("table_lack", 0, 0)
    env.reset(seed=0)
    for front in (env, dm):
        with monkeypatch.context() as patch, pytest.raises(StartError):
            unsettled(front.world, patch)
            front.reset()
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(9))
    assert dm.step(np.zeros(9)).first()  # which begins the episode that could not begin before
    env.reset()
    env.step(np.zeros(9))


@pytest.mark.parametrize(
    "action", [np.zeros((2, 9)), [[0.0] * 9] * 2, torch.zeros(2, 9, dtype=torch.complex64)]
)
def test_an_action_is_a_tensor_of_real_numbers(action):
    world = tstar_envs.load("table_lack", 2, 0, 1, 0)
    world.reset()
    for running in (None, torch.tensor([True, False])):
        with pytest.raises(ValueError, match="an action of table_lack is a tensor of real numbers, got "):
            world.step(action, running)


@pytest.mark.parametrize(
    "mask", [torch.ones(3, dtype=torch.bool), torch.ones(2), torch.tensor([[True], [True]]), [True, True]]
)
def test_a_mask_of_another_shape_or_type_is_refused(mask):
    world = tstar_envs.load("table_lack", 2, 0, 1, 0)
    world.reset()
    snapshot = world.snapshot()
    for take in (
        world.reset,
        lambda mask: world.restore(snapshot, mask),
        lambda mask: world.reset_to(snapshot, mask),
    ):
        with pytest.raises(ValueError, match=r"a mask of shape \(2,\), torch\.bool; got"):
            take(mask)


def test_a_subtask_may_be_any_whole_number():
    world = BatchedEnvironment("table_lack", 1, np.int64(1), nthread=1)
    assert world.subtask == 1 and type(world.arguments["subtask"]) is int
    for wrong in (True, 1.0, np.int64(4), np.bool_(True)):
        with pytest.raises(ValueError, match="subtask of table_lack must be None"):
            BatchedEnvironment("table_lack", 1, wrong, nthread=1)


@pytest.mark.parametrize("name", [3, ["table_lack"], None])
def test_furniture_is_called_by_a_name(name):
    with pytest.raises(FurnitureError, match=r"furniture is called by a name, got .*valid: .*'table_lack'"):
        library.load(name)
