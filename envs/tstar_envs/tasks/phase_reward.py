"""The dense reward of one subtask: eight phases, each a potential to lower and a condition to meet.

A phase's *potential* is its clipped distances times their coefficients; the reward of a step is ten times what the
potential of the current phase fell by, and a bonus when its condition holds. Everything is computed for all eight
phases at once, (N, 8), and the current one is picked, so no shape depends on data.

Source: environment.md, "Dense reward of one subtask".
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from tstar_envs.connection import Alignment

PHASES = (
    "init_eef",
    "move_eef_above_leg",
    "lower_eef",
    "grasp_leg",
    "lift_leg",
    "align_leg",
    "move_leg",
    "move_leg_fine",
)
BONUS = 5000.0
BONUS_SHARES = (1.0, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0)
DIFFERENCE_SCALE = 10.0
ABOVE, BELOW = 0.05, 0.015
"""Height of the way point above the grasp point, and of the grasping tip below it, m."""
MIN_GRIP_COSINE = 0.95
OFF_GROUND = 0.01
"""Height above its start at which a lifted part earns half a bonus, m."""


class Scene(NamedTuple):
    """What the reward looks at; positions in m, world frame."""

    tip: Tensor  # (N, 3) between the finger tips
    approach: Tensor  # (N, 3) the hand's z axis
    closing: Tensor  # (N, 3) the hand's y axis
    part: Tensor  # (N, 3) the moving part
    grasp_point: Tensor  # (N, 3)
    grasp_axis: Tensor  # (N, 3)
    grip_direction: Tensor  # (N, 3) the approach direction asked for while grasping
    retreat: Tensor  # (N, 3) unit, from the grasp point to where the hand waits before it grasps
    way_out: Tensor  # (N, 3) unit, from the target connector to where the moving one comes from
    moving_connector: Tensor  # (N, 3)
    target_connector: Tensor  # (N, 3)
    alignment: Alignment
    touching: Tensor  # (N,) bool, both fingers on the moving part or on what is welded to it


def potentials(scene: Scene, start_tip: Tensor, lift_point: Tensor, z_finedist: float) -> Tensor:
    """Potential of each phase, (N, 8)."""
    lift = (scene.part - lift_point).norm(dim=-1)
    return torch.stack(
        [
            init_eef(scene, start_tip),
            move_eef_above_leg(scene),
            lower_eef(scene),
            lower_eef(scene),
            lift_leg(scene, lift_point),
            align_leg(scene.alignment, lift),
            move_leg(scene, z_finedist),
            move_leg_fine(scene.alignment),
        ],
        dim=-1,
    )


def init_eef(scene: Scene, start_tip: Tensor) -> Tensor:
    """Potential (N,) of phase 0: the tip near where the subtask began."""
    return -100.0 * torch.exp(-10.0 * (scene.tip - start_tip).norm(dim=-1).clamp_max(0.5))


def move_eef_above_leg(scene: Scene) -> Tensor:
    """Potential (N,) of phase 1: the tip to a point above the grasp point, or behind it."""
    return 100.0 * (scene.tip - _moved(scene.grasp_point, ABOVE, scene.retreat)).norm(dim=-1).clamp_max(1.0)


def lower_eef(scene: Scene) -> Tensor:
    """Potential (N,) of phases 2 and 3: the tip to a point below the grasp point."""
    return 1000.0 * (scene.tip - _moved(scene.grasp_point, -BELOW, scene.retreat)).norm(dim=-1).clamp_max(0.2)


def lift_leg(scene: Scene, lift_point: Tensor) -> Tensor:
    """Potential (N,) of phase 4: the part to the lift point."""
    offset = scene.part - lift_point
    return 500.0 * offset[:, 2].abs().clamp_max(0.5) + 250.0 * offset[:, :2].norm(dim=-1).clamp_max(0.8)


def align_leg(alignment: Alignment, lift_distance: Tensor) -> Tensor:
    """Potential (N,) of phase 5: connectors parallel, near the lift point."""
    return 100.0 * lift_distance.clamp_max(0.4) - 50.0 * (alignment.up_cosine + alignment.forward_cosine)


def move_leg(scene: Scene, z_finedist: float) -> Tensor:
    """Potential (N,) of phase 6: the connector to a point above its target, or before it along its axis."""
    cosines = scene.alignment.up_cosine.clamp_min(0) + scene.alignment.forward_cosine.clamp_min(0)
    return 300.0 * _fine_distance(scene, z_finedist).clamp_max(0.5) - 50.0 * cosines


def move_leg_fine(alignment: Alignment) -> Tensor:
    """Potential (N,) of phase 7: connectors together, parallel, on one line."""
    close = 500.0 * torch.exp(-25.0 * alignment.distance)
    cosines = torch.stack([alignment.up_cosine, alignment.forward_cosine])
    projections = torch.stack([alignment.moving_projection, alignment.target_projection])
    upright = 200.0 * torch.exp(-2.0 * (1 - cosines)).sum(0)
    over = 100.0 * torch.exp(-3.0 * (1 - projections.abs())).sum(0)
    return -(close + upright + over)


def conditions(
    scene: Scene,
    start_tip: Tensor,
    lift_point: Tensor,
    z_finedist: float,
    hand_open: Tensor,
    connected: Tensor,
) -> Tensor:
    """Whether each phase's condition holds, (N, 8) bool."""
    to_lower = scene.tip - _moved(scene.grasp_point, -BELOW, scene.retreat)
    to_lift = scene.part - lift_point
    upright = (scene.alignment.up_cosine > 0.85) & (scene.alignment.forward_cosine > 0.85) & scene.touching
    down = (scene.approach * scene.grip_direction).sum(-1) > MIN_GRIP_COSINE
    gripping = down & ((scene.closing * scene.grasp_axis).sum(-1).abs() > MIN_GRIP_COSINE)
    at_start = (scene.tip - start_tip).norm(dim=-1) < 0.03
    above = (scene.tip - _moved(scene.grasp_point, ABOVE, scene.retreat)).norm(dim=-1) < 0.03
    depth = (to_lower * scene.retreat).sum(-1, keepdim=True)
    beside = (to_lower - depth * scene.retreat).norm(dim=-1)
    lowered = (beside < 0.02) & (depth.squeeze(-1).abs() < 0.015)
    held = scene.touching & (((scene.tip - scene.grasp_point) * scene.retreat).sum(-1) < 0)
    lifted = (to_lift[:, 2].abs() < 0.02) & (to_lift[:, :2].norm(dim=-1) < 0.05)
    return torch.stack(
        [
            at_start & down & hand_open,
            above & gripping & hand_open,
            lowered & gripping & hand_open,
            held & gripping,
            lifted & gripping,
            (to_lift.norm(dim=-1) < 0.2) & upright,
            (_fine_distance(scene, z_finedist) < 0.06) & upright,
            connected,
        ],
        dim=-1,
    )


def off_ground(scene: Scene, lift_point: Tensor, rise: Tensor) -> Tensor:
    """Whether the part is a centimetre above where it lay, (N,) bool; the lift point is `rise` (N,), m, above that."""
    return scene.part[:, 2] > lift_point[:, 2] - rise + OFF_GROUND


def grip_penalty(scene: Scene, phase: Tensor) -> Tensor:
    """Reward (at most 0) for the hand's axes while a part is taken, (N,)."""
    tilt = 4.0 * ((scene.approach * scene.grip_direction).sum(-1) - 1) * (phase <= 4)
    turn = 2.0 * ((scene.closing * scene.grasp_axis).sum(-1).abs() - 1) * ((phase >= 1) & (phase <= 4))
    return tilt + turn


def _fine_distance(scene: Scene, z_finedist: float) -> Tensor:
    return (scene.moving_connector - _moved(scene.target_connector, z_finedist, scene.way_out)).norm(dim=-1)


def _moved(point: Tensor, by: float, direction: Tensor) -> Tensor:
    return point + by * direction
