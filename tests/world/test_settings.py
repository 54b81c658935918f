"""Settings of the task: what each takes, and what a wrong one is told."""

import pytest

from tstar_envs.settings import TaskSettings


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
        ({"preassembled": "jiter"}, "setting preassembled must be one of ideal, jitter; got 'jiter'"),
    ],
)
def test_a_wrong_value_is_told_what_is_right(values, message):
    with pytest.raises(ValueError, match=message):
        TaskSettings.from_mapping(values)


def test_whole_numbers_may_stand_for_real_ones():
    assert TaskSettings.from_mapping({"part_noise": 0, "velocity_scale": 1}).velocity_scale == 1
