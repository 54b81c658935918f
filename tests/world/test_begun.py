"""Simulations in which no episode was begun are not stepped; masks and subtasks are checked as they are given."""

import numpy as np
import pytest
import torch

import tstar_envs
from tstar_envs.environment import BatchedEnvironment
from tstar_envs.furniture import FurnitureError, library

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
