"""The eight phases on numbers worked by hand. Source: docs/task.md, "The phases"."""

import math

import pytest
import torch
from scenes import GRASP, NO, OPEN, alignment, measured, row, scene
from torch import Tensor
from torch.testing import assert_close

from tstar_envs.tasks import phase_reward
from tstar_envs.tasks.measures import MEASURES, VECTORS
from tstar_envs.tasks.phase_reward import PhaseTables

PHASES = {name: i for i, name in enumerate(phase_reward.PHASES)}
TABLES = PhaseTables(torch.device("cpu"))


def potential(phase: str, **changed) -> float:
    return TABLES.potentials(scene(**changed).measures)[0, PHASES[phase]].item()


def met(phase: str, hand_open: Tensor = OPEN, connected: Tensor = NO, **changed) -> bool:
    found = scene(**changed)
    held = TABLES.conditions(found.measures, found.touching, hand_open, connected)
    return bool(held[PHASES[phase], 0])


def test_potentials_are_in_the_order_of_the_phases():
    found = TABLES.potentials(scene().measures)[0]
    over, below = (
        math.hypot(0.3, 0.24),
        0.2,
    )  # the tip to 5 cm above the grasp point; to 1.5 cm below: clipped
    assert_close(found[0].item(), -100.0)
    assert_close(found[1].item(), 100 * over)
    assert_close(found[2:4].tolist(), [1000 * below, 1000 * below])
    assert_close(found[4].item(), 500 * 0.1)
    assert_close(found[5].item(), 100 * 0.1 - 50 * 2)
    assert_close(found[6].item(), 300 * 0.15 - 50 * 2)  # 0.3 is 0.15 over z_finedist above the target
    assert_close(found[7].item(), -(500 * math.exp(-5.0) + 400 + 200))


def test_init_eef_clips_at_half_a_metre():
    assert_close(potential("init_eef", tip=row(9, 9, 9)), -100 * math.exp(-5.0))
    assert_close(potential("init_eef", tip=row(0.5, 0.2, 0.3)), -100 * math.exp(-1.0))


def test_reaching_potentials():
    assert_close(potential("move_eef_above_leg", tip=row(0.1, 0.2, 0.36)), 100 * 0.3)
    assert_close(potential("move_eef_above_leg", tip=row(9, 9, 9)), 100.0)
    for phase in ("lower_eef", "grasp_leg"):
        assert_close(potential(phase, tip=row(0.1, 0.2, 0.095)), 1000 * 0.1)


def test_lift_leg_takes_height_and_plane_apart():
    moved = row(0.13, 0.24, 0.05)  # 6 cm under, 5 cm beside the lift point
    assert_close(potential("lift_leg", part=moved), 500 * 0.06 + 250 * 0.05)
    assert_close(potential("lift_leg", part=row(9, 9, 9)), 500 * 0.5 + 250 * 0.8)


def test_align_and_move_leg():
    lying = alignment(up=-0.5, forward=0.2)
    assert_close(potential("align_leg", alignment=lying, part=row(0.1, 0.2, 0.81)), 40 + 15.0)
    assert_close(potential("move_leg", alignment=lying), 300 * 0.15 - 50 * 0.2)
    assert_close(potential("move_leg", alignment=lying, moving_connector=row(5, 5, 5)), 300 * 0.5 - 50 * 0.2)


def test_move_leg_fine():
    found = potential("move_leg_fine", alignment=alignment(0.04, 0.9, 0.8, -0.5, 0.25))
    close, upright = 500 * math.exp(-1.0), 200 * (math.exp(-0.2) + math.exp(-0.4))
    assert_close(found, -(close + upright + 100 * (math.exp(-1.5) + math.exp(-2.25))))


def test_what_is_measured_between_connectors():
    """The moving one is turned by 60 degrees about x and lies at 3-4-5 in y and z from the target."""
    vectors = torch.zeros(3, len(VECTORS), 1, dtype=torch.float64)
    half, root = 0.5, math.sqrt(0.75)
    named = {
        "moving.y": (0, half, root), "moving.z": (0, -root, half), "target.x": (1, 0, 0),
        "target.y": (0, 1, 0), "target.z": (0, 0, 1), "target.connector": (0, 0.03, 0.04), "start_target": (0, 0.03, 0),
        "hand.origin": (0, 0, -0.02), "hand.y": (0, -1, 0), "moving.grasp_axis": (0, 0.6, 0.8),
        "retreat": (0, 0, 1), "target.way_out": (0, 0, 1), "up": (0, 0, 1),
    }  # fmt: skip
    for name, value in named.items():
        vectors[:, VECTORS[name]] = row(*value).t()
    found = {name: measured(vectors)[i, 0].item() for name, i in MEASURES.items()}
    assert_close(found["gap"], 0.05)
    assert_close(found["to_fine"], math.hypot(0.03, 0.04 + 0.05))
    assert_close(found["target_moved"], 0.04)
    assert_close([found["up"], found["forward"]], [0.5, 0.5])
    assert_close(found["moving_projection"], -root * 0.6 + half * 0.8)
    assert_close(found["target_projection"], 0.8)
    assert_close([found["tip_over_grasp"], found["tip_to_below_height"]], [-0.02, 0.005])
    assert_close(found["turn"], 0.6)


@pytest.mark.parametrize(
    ("phase", "yes", "no"),
    [
        ("init_eef", {"tip": row(0.4, 0.2, 0.329)}, {"tip": row(0.4, 0.2, 0.331)}),
        ("move_eef_above_leg", {"tip": row(0.1, 0.2, 0.089)}, {"tip": row(0.1, 0.2, 0.091)}),
        ("lower_eef", {"tip": row(0.119, 0.2, 0.009)}, {"tip": row(0.121, 0.2, 0.009)}),
        ("lower_eef", {"tip": row(0.1, 0.2, 0.0099)}, {"tip": row(0.1, 0.2, 0.0101)}),
        ("lift_leg", {"part": row(0.149, 0.2, 0.11)}, {"part": row(0.151, 0.2, 0.11)}),
        ("lift_leg", {"part": row(0.1, 0.2, 0.091)}, {"part": row(0.1, 0.2, 0.089)}),
    ],
)
def test_conditions_of_reaching_and_lifting(phase, yes, no):
    assert met(phase, **yes) and not met(phase, **no)
    if phase != "init_eef":
        turned = row(0.94, math.sqrt(1 - 0.94**2), 0)
        assert not met(phase, **yes, closing=turned) and met(phase, **yes, closing=row(-1, 0, 0))
    if phase != "lift_leg":
        assert not met(phase, hand_open=NO, **yes)
        assert not met(phase, **yes, approach=row(0, math.sqrt(1 - 0.94**2), -0.94))


def test_conditions_of_holding():
    below, above = {"tip": row(0.1, 0.2, 0.005)}, {"tip": row(0.1, 0.2, 0.015)}
    assert met("grasp_leg", **below, touching=OPEN)
    assert not met("grasp_leg", **below) and not met("grasp_leg", **above, touching=OPEN)
    upright, leaning = alignment(up=0.86, forward=0.86), alignment(up=0.86, forward=0.84)
    over, away = row(0, 0, 0.209), row(0, 0, 0.211)  # 6 cm around 5 cm above the target
    assert met("align_leg", alignment=upright, touching=OPEN)
    assert not met("align_leg", alignment=leaning, touching=OPEN) and not met("align_leg", alignment=upright)
    assert not met("align_leg", alignment=upright, touching=OPEN, part=row(0.1, 0.2, 0.32))
    assert met("move_leg", alignment=upright, touching=OPEN, moving_connector=over)
    assert not met("move_leg", alignment=upright, touching=OPEN, moving_connector=away)
    assert not met("move_leg", alignment=leaning, touching=OPEN, moving_connector=over)
    assert met("move_leg_fine", connected=OPEN) and not met("move_leg_fine")


def test_a_part_taken_from_the_side_is_waited_for_behind_it():
    x, y, z = GRASP
    side = {"retreat": row(0, 1, 0), "grip_direction": row(0, -1, 0), "approach": row(0, -1, 0)}
    assert_close(potential("move_eef_above_leg", tip=row(x, y + 0.05, z), **side), 0.0)
    assert_close(potential("move_eef_above_leg", tip=row(x, y, z + 0.12), **side), 100 * 0.13)
    for phase in ("lower_eef", "grasp_leg"):
        assert_close(potential(phase, tip=row(x, y - 0.015, z), **side), 0.0)
    assert met("move_eef_above_leg", tip=row(x, y + 0.021, z), **side)
    assert not met("move_eef_above_leg", tip=row(x, y, z + 0.05), **side)
    assert met("lower_eef", tip=row(x, y - 0.001, z + 0.019), **side)
    assert not met("lower_eef", tip=row(x, y - 0.001, z + 0.021), **side)
    assert not met("lower_eef", tip=row(x, y + 0.001, z + 0.019), **side)
    holds = {**side, "touching": OPEN}
    assert met("grasp_leg", tip=row(x, y - 0.01, z + 0.01), **holds)
    assert not met("grasp_leg", tip=row(x, y + 0.01, z - 0.01), **holds)


def test_a_connector_that_comes_along_an_axis_is_brought_before_its_target():
    slope = row(0.6, 0, 0.8)
    before = row(0, 0, 0.1) + 0.05 * slope
    assert_close(potential("move_leg", moving_connector=before, way_out=slope), -100.0)
    assert_close(potential("move_leg", moving_connector=before), 300 * math.hypot(0.03, 0.01) - 100)
    away = row(0, 0, 0.1) - 0.011 * slope  # 61 mm off
    assert met("move_leg", moving_connector=before, way_out=slope, touching=OPEN)
    assert not met("move_leg", moving_connector=away, way_out=slope, touching=OPEN)
