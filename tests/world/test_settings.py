"""Settings of the task: what each takes, and what a wrong one is told."""

import dataclasses
import json

import numpy as np
import pytest
import torch
from worlds import make

from tstar_envs.checks import finite_number, whole_number
from tstar_envs.settings import MOST, MOST_STEPS, TaskSettings
from tstar_envs.snapshot_check import APART


@pytest.mark.parametrize(
    "values, message",
    [
        ({"snap": "false"}, "setting snap must be of type bool, got 'false'"),
        ({"part_noise": "0.02"}, "setting part_noise must be of type float, got '0.02'"),
        ({"part_noise": -0.01}, "setting part_noise must not be negative, got -0.01"),
        ({"arm_noise": float("nan")}, "setting arm_noise must be finite, got nan"),
        ({"retreat_steps": -1, "reset_robot": False}, "setting retreat_steps must not be negative, got -1"),
        ({"retreat_steps": 3}, "setting retreat_steps=3 needs reset_robot=false"),
        ({"max_steps": 2.5}, "setting max_steps must be of type int, got 2.5"),
        ({"max_steps": True}, "setting max_steps must be of type int, got True"),
        ({"gripper": None}, "setting gripper must be of type str, got None"),
        ({"part_noise": 1e6}, "setting part_noise must be from 0 to 0.25, got 1000000.0"),
        ({"part_noise_degrees": 181}, "setting part_noise_degrees must be from 0 to 180, got 181"),
        ({"drop_height": 1000}, "setting drop_height must be from 0 to 0.2, got 1000"),
        ({"arm_noise": 10}, "setting arm_noise must be from 0 to 1, got 10"),
        ({"jitter": 0.2}, "setting jitter must be from 0 to 0.04, got 0.2"),
        ({"jitter_degrees": 50.0}, "setting jitter_degrees must be from 0 to 45, got 50.0"),
        ({"part_noise": 10**400}, "setting part_noise must be finite, got 1000"),
        ({"max_steps": 10**5000}, "setting max_steps must be finite, got a very long number"),
        ({"settle_steps": 10**6}, "setting settle_steps must be from 1 to 100000, got 1000000"),
        (
            {"retreat_steps": 10**6, "reset_robot": False},
            "setting retreat_steps must be from 0 to 10000, got 1000000",
        ),
        ({"max_steps": 10**19}, "setting max_steps must be from 1 to 1000000, got 10000000000000000000"),
        (["max_steps"], r"settings are a mapping of names to values, got \['max_steps'\]"),
        ({1: 2}, "unknown task setting 1; valid settings: velocity_scale"),
        ({"preassembled": "jiter"}, "setting preassembled must be one of ideal, jitter; got 'jiter'"),
    ],
)
def test_a_wrong_value_is_told_what_is_right(values, message):
    with pytest.raises(ValueError, match=message):
        TaskSettings.from_mapping(values)


def test_whole_numbers_may_stand_for_real_ones():
    assert TaskSettings.from_mapping({"part_noise": 0, "velocity_scale": 1}).velocity_scale == 1


def test_numbers_of_numpy_become_plain_ones():
    settings = TaskSettings(velocity_scale=np.float32(0.5), max_steps=np.int64(5))
    assert json.loads(json.dumps(dataclasses.asdict(settings)))["velocity_scale"] == 0.5
    assert settings == TaskSettings(velocity_scale=0.5, max_steps=5) and type(settings.max_steps) is int
    subclasses = TaskSettings(velocity_scale=np.float64(0.5), gripper=np.str_("sign"))
    assert type(subclasses.velocity_scale) is float and type(subclasses.gripper) is str


def test_the_longest_episode_can_be_stepped():
    world = make(1, max_steps=MOST_STEPS["max_steps"])
    world.step(torch.zeros(1, 9))
    assert not world.task.get_termination(world.state)[1]


@pytest.mark.parametrize("digits, said", [(400, "1000"), (5000, "a very long number")])
def test_a_number_that_no_float_holds_is_told(digits, said):
    with pytest.raises(ValueError, match=f"^x must be a finite number, got {said}"):
        finite_number("x", 10**digits)
    with pytest.raises(ValueError, match=f"^x must be a whole number from 0 to 9, got {said}"):
        whole_number("x", 10**digits, 0, 9)


@pytest.mark.parametrize("name", ["table_lack", "chair_ingolf"])
def test_an_environment_takes_its_own_snapshots_at_the_largest_values(name):
    """The last subtask, every step before it jittered by up to that, the arm within its joints' ranges."""
    assert MOST["jitter"] * 3**0.5 < 0.8 * APART
    world = make(32, 3, name=name, preassembled="jitter", **MOST)
    snapshot = world.snapshot()
    world.reset_to(snapshot)
    world.step(torch.zeros(32, 9, dtype=torch.float64))
    low, high = torch.from_numpy(world.model.jnt_range[:7].T)
    arm = world.qpos_of(snapshot)[:, :7]
    assert (low < arm).all() and (arm < high).all()
