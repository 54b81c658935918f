"""How far off its own starts a skill is handed the world, on states made by hand."""

import math

import pytest
import torch

from tstar_rl.env.layout import PARTS, observation_size
from tstar_rl.seams.off_starts import off_starts

TOP, LEG = 0, 1


def states(*tilts: float, turned: float = 0.0, joint: float = 0.0) -> torch.Tensor:
    """A top turned about z by `turned` rad, and a leg 0.1 m along its x axis, tilted by degrees about its own x."""
    found = torch.zeros(len(tilts), observation_size(2))
    found[:, 2] = joint
    top, leg = (found[:, PARTS + 7 * part : PARTS + 7 * part + 7] for part in (TOP, LEG))
    half = torch.deg2rad(torch.tensor(tilts)) / 2
    c, s = math.cos(turned / 2), math.sin(turned / 2)
    top[:, 0] = 0.3
    top[:, 3], top[:, 6] = c, s
    leg[:, 0], leg[:, 1] = 0.3 + 0.1 * math.cos(turned), 0.1 * math.sin(turned)
    leg[:, 3], leg[:, 4], leg[:, 5], leg[:, 6] = (
        c * half.cos(),
        c * half.sin(),
        s * half.sin(),
        s * half.cos(),
    )
    return found


def test_a_joined_part_is_measured_from_the_part_that_it_is_joined_to():
    """Its tilts of 3, 4 and 5 degrees are off the upright one that the skill knows; how the table stands is not."""
    handed, own = states(3.0, -4.0, 5.0, turned=0.4), states(0.0, 0.0)
    handed[1, PARTS + 10 : PARTS + 14] *= -1  # the same turn
    found = off_starts(handed, own, ("top", "leg"), {LEG: TOP})
    assert found["leg orientation"].handed == pytest.approx(4.0, abs=1e-3)
    assert found["leg position"].handed == pytest.approx(0.0, abs=1e-6)
    assert found["top orientation"].handed == pytest.approx(math.degrees(0.4), abs=1e-3)
    assert found["leg orientation"].own == pytest.approx(0.0, abs=1e-3)


def test_a_part_that_lies_alone_is_measured_in_the_world():
    handed = states(0.0)
    handed[:, PARTS + 7 : PARTS + 10] += torch.tensor([0.03, 0.04, 0.0])
    found = off_starts(handed, states(0.0, 0.0), ("top", "leg"))
    assert found["leg position"].handed == pytest.approx(0.05, abs=1e-6)
    assert list(found) == [
        "robot", "top position", "top orientation", "leg position", "leg orientation"
    ]  # fmt: skip


def test_distances_are_from_the_mean_of_the_own_starts_whose_own_spread_is_said():
    """Joint 2 at .1 and .3 rad in training, at .5 when it is handed: .3 rad off, where training was .1 off."""
    own = torch.cat([states(-1.0, joint=0.1), states(1.0, joint=0.3)])
    found = off_starts(states(0.0, joint=0.5), own, ("top", "leg"))
    assert found["robot"].handed == pytest.approx(math.degrees(0.3), abs=1e-4)
    assert found["robot"].own == pytest.approx(math.degrees(0.1), abs=1e-4)
    assert found["leg orientation"].own == pytest.approx(1.0, abs=1e-3)
    assert found["leg orientation"].handed == pytest.approx(0.0, abs=1e-3)


def test_one_leg_that_stands_quite_otherwise_changes_little():
    found = off_starts(states(1.0, 2.0, 3.0, 90.0), states(0.0, 0.0), ("top", "leg"), {LEG: TOP})
    assert found["leg orientation"].handed == pytest.approx(2.5, abs=1e-3)


def test_a_seam_that_nothing_reaches_is_off_by_nan():
    found = off_starts(states(0.0)[:0], states(0.0), ("top", "leg"), {LEG: TOP})
    assert all(math.isnan(each.handed) and each.own == 0 for name, each in found.items() if name != "robot")
    assert math.isnan(found["robot"].handed)
