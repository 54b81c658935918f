"""The eight phases on numbers worked by hand. Source of the figures: environment.md, "Dense reward"."""

import math

import pytest
import torch
from torch import Tensor
from torch.testing import assert_close

from tstar_envs.connection import Alignment
from tstar_envs.tasks import phase_reward
from tstar_envs.tasks.phase_reward import Scene

GRASP, LIFT, START = (0.1, 0.2, 0.01), (0.1, 0.2, 0.11), (0.4, 0.2, 0.3)
PHASES = {name: i for i, name in enumerate(phase_reward.PHASES)}
OPEN, NO = torch.tensor([True]), torch.tensor([False])


def row(*values: float) -> Tensor:
    return torch.tensor([values], dtype=torch.float64)


def alignment(distance=0.2, up=1.0, forward=1.0, moving=1.0, target=1.0) -> Alignment:
    return Alignment(
        *(torch.tensor([v], dtype=torch.float64) for v in (distance, up, forward, moving, target))
    )


def scene(**changed) -> Scene:
    """The hand at its start over a lying part, 0.2 m from the target."""
    base = {
        "tip": row(*START), "approach": row(0, 0, -1), "closing": row(1, 0, 0), "part": row(*GRASP),
        "grasp_point": row(*GRASP), "grasp_axis": row(1, 0, 0), "grip_direction": row(0, 0, -1),
        "retreat": row(0, 0, 1), "way_out": row(0, 0, 1),
        "moving_connector": row(0, 0, 0.3), "target_connector": row(0, 0, 0.1), "alignment": alignment(),
        "touching": NO,
    }  # fmt: skip
    return Scene(**{**base, **changed})


def met(phase: str, hand_open: Tensor = OPEN, connected: Tensor = NO, **changed) -> bool:
    found = phase_reward.conditions(scene(**changed), row(*START), row(*LIFT), 0.05, hand_open, connected)
    return bool(found[0, PHASES[phase]])


def test_potentials_are_in_the_order_of_the_phases():
    found = phase_reward.potentials(scene(), row(*START), row(*LIFT), 0.05)[0]
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
    far = scene(tip=row(9, 9, 9))
    assert_close(phase_reward.init_eef(far, row(*START)).item(), -100 * math.exp(-5.0))
    assert_close(
        phase_reward.init_eef(scene(tip=row(0.5, 0.2, 0.3)), row(*START)).item(), -100 * math.exp(-1.0)
    )


def test_reaching_potentials():
    assert_close(phase_reward.move_eef_above_leg(scene(tip=row(0.1, 0.2, 0.36))).item(), 100 * 0.3)
    assert_close(phase_reward.move_eef_above_leg(scene(tip=row(9, 9, 9))).item(), 100.0)
    assert_close(phase_reward.lower_eef(scene(tip=row(0.1, 0.2, 0.095))).item(), 1000 * 0.1)


def test_lift_leg_takes_height_and_plane_apart():
    moved = scene(part=row(0.13, 0.24, 0.05))  # 6 cm under, 5 cm beside the lift point
    assert_close(phase_reward.lift_leg(moved, row(*LIFT)).item(), 500 * 0.06 + 250 * 0.05)
    assert_close(phase_reward.lift_leg(scene(part=row(9, 9, 9)), row(*LIFT)).item(), 500 * 0.5 + 250 * 0.8)


def test_align_and_move_leg():
    lying = alignment(up=-0.5, forward=0.2)
    assert_close(phase_reward.align_leg(lying, torch.tensor([0.7], dtype=torch.float64)).item(), 40 + 15.0)
    assert_close(phase_reward.move_leg(scene(alignment=lying), 0.05).item(), 300 * 0.15 - 50 * 0.2)
    far = scene(alignment=lying, moving_connector=row(5, 5, 5))
    assert_close(phase_reward.move_leg(far, 0.05).item(), 300 * 0.5 - 50 * 0.2)


def test_move_leg_fine():
    found = phase_reward.move_leg_fine(alignment(0.04, 0.9, 0.8, -0.5, 0.25)).item()
    close, upright = 500 * math.exp(-1.0), 200 * (math.exp(-0.2) + math.exp(-0.4))
    assert_close(found, -(close + upright + 100 * (math.exp(-1.5) + math.exp(-2.25))))


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


def test_grip_penalty_follows_the_phase():
    leaning = scene(approach=row(0, 0.6, -0.8), closing=row(-0.5, math.sqrt(0.75), 0))
    found = [phase_reward.grip_penalty(leaning, torch.tensor([phase])).item() for phase in range(8)]
    assert_close(found, [4 * -0.2] + [4 * -0.2 + 2 * -0.5] * 4 + [0.0] * 3)


@pytest.mark.parametrize("rise", [0.05, 0.27])
def test_off_the_ground_is_a_centimetre_wherever_the_lift_point_is(rise):
    lift_point, rise = row(0.0, 0.0, 0.03 + rise), torch.tensor([rise], dtype=torch.float64)
    assert not phase_reward.off_ground(scene(part=row(0, 0, 0.0399)), lift_point, rise).item()
    assert phase_reward.off_ground(scene(part=row(0, 0, 0.0401)), lift_point, rise).item()


def test_a_part_taken_from_the_side_is_waited_for_behind_it():
    x, y, z = GRASP
    side = {"retreat": row(0, 1, 0), "grip_direction": row(0, -1, 0), "approach": row(0, -1, 0)}
    assert_close(phase_reward.move_eef_above_leg(scene(tip=row(x, y + 0.05, z), **side)).item(), 0.0)
    assert_close(phase_reward.lower_eef(scene(tip=row(x, y - 0.015, z), **side)).item(), 0.0)
    assert met("lower_eef", tip=row(x, y - 0.01, z), **side)
    assert not met("lower_eef", tip=row(x, y - 0.01, z + 0.03), **side)
    holds = {**side, "touching": ~NO}
    assert met("grasp_leg", tip=row(x, y - 0.01, z), **holds)
    assert not met("grasp_leg", tip=row(x, y + 0.01, z), **holds)


def test_a_connector_that_comes_along_an_axis_is_brought_before_its_target():
    slope = row(0.6, 0, 0.8)
    before = row(0, 0, 0.1) + 0.05 * slope
    assert_close(phase_reward.move_leg(scene(moving_connector=before, way_out=slope), 0.05).item(), -100.0)
    assert met("move_leg", moving_connector=before, way_out=slope, touching=~NO)
