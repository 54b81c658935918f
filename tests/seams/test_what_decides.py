"""What decides an outcome: on states whose outcome is known to hang on one part's position."""

import math

import torch

from tstar_rl.env.layout import observation_size
from tstar_rl.seams.what_decides import (
    input_groups,
    input_names,
    strongest_input,
    what_decides,
)

PARTS = ("top", "leg")
GROUPS = input_groups(PARTS)


def states(number: int = 400) -> torch.Tensor:
    generator = torch.Generator().manual_seed(0)
    return torch.randn(number, observation_size(len(PARTS)), generator=generator)


def test_groups_are_the_robot_and_each_part_and_leave_the_phase_out():
    assert list(GROUPS) == ["robot", "top position", "top orientation", "leg position", "leg orientation"]
    together = [index for columns in GROUPS.values() for index in columns]
    assert together == list(range(observation_size(2) - 8))
    assert GROUPS["leg position"] == [36, 37, 38]


def test_the_group_that_decides_is_found_and_no_other():
    observations = states()
    outcomes = observations[:, GROUPS["leg position"][0]] > 0
    decision = what_decides(observations, outcomes, GROUPS)
    assert decision.area > 0.95
    assert decision.falls["leg position"] > 0.35
    assert all(abs(fall) < 0.05 for name, fall in decision.falls.items() if name != "leg position")


def test_every_input_has_a_name_and_the_strongest_is_found():
    names = input_names(PARTS)
    assert len(names) == len(set(names)) == observation_size(2) - 8
    assert (names[0], names[18], names[GROUPS["leg position"][1]]) == ("joint 0", "hand z", "leg y")
    observations = states()
    won = observations[:, 18] + 0.1 * observations[:, 0] < 0
    name, area = strongest_input(observations, won, names)
    assert name == "hand z" and area < 0.05
    assert strongest_input(observations, torch.ones(400, dtype=torch.bool), names)[0] == ""


def test_outcomes_by_chance_are_not_told_from_states_that_were_not_trained_on():
    generator = torch.Generator().manual_seed(1)
    decision = what_decides(states(), torch.rand(400, generator=generator) < 0.5, GROUPS)
    assert abs(decision.area - 0.5) < 0.1


def test_the_sign_of_a_quaternion_decides_nothing():
    observations, columns = states(), GROUPS["leg orientation"]
    observations[:, columns] = torch.nn.functional.normalize(
        torch.tensor([1.0, 0.0, 0.0, 0.0]) + 0.01 * observations[:, columns], dim=-1
    )
    flipped = torch.arange(400) % 2 == 0
    observations[:, columns] = torch.where(
        flipped.unsqueeze(-1), -observations[:, columns], observations[:, columns]
    )
    assert abs(what_decides(observations, flipped, GROUPS).area - 0.5) < 0.1


def test_the_same_seed_says_the_same_and_few_outcomes_say_nothing():
    observations = states(200)
    outcomes = observations[:, 0] > 0
    assert what_decides(observations, outcomes, GROUPS, 3) == what_decides(observations, outcomes, GROUPS, 3)
    rare = torch.zeros(200, dtype=torch.bool)
    rare[:19] = True
    nothing = what_decides(observations, rare, GROUPS)
    assert math.isnan(nothing.area) and all(math.isnan(fall) for fall in nothing.falls.values())
