"""The reward as its definition reads, one phase after another: what the tables of `tasks.phase_reward` must equal.

Slower and longer than the tables, and easier to check against docs/task.md, "Dense reward of one subtask".
"""

from __future__ import annotations

import torch
from torch import Tensor

from tstar_envs.connection import Alignment, align
from tstar_envs.tasks.assembly import Assembly
from tstar_envs.tasks.measures import ABOVE, BELOW
from tstar_envs.tasks.phase_reward import BONUS, BONUS_SHARES, DIFFERENCE_SCALE, MIN_GRIP_COSINE
from tstar_envs.tasks.scene_reader import OFF_GROUND, Scene


def _norm(vectors: Tensor) -> Tensor:
    return vectors.square().sum(-1).sqrt()


def potentials(scene: Scene, start_tip: Tensor, lift_point: Tensor, z_finedist: float) -> Tensor:
    """Potential of each phase, (N, 8)."""
    lift = _norm(scene.part - lift_point)
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
    return -100.0 * torch.exp(-10.0 * _norm(scene.tip - start_tip).clamp_max(0.5))


def move_eef_above_leg(scene: Scene) -> Tensor:
    """Potential (N,) of phase 1: the tip to a point above the grasp point, or behind it."""
    return 100.0 * _norm(scene.tip - _moved(scene.grasp_point, ABOVE, scene.retreat)).clamp_max(1.0)


def lower_eef(scene: Scene) -> Tensor:
    """Potential (N,) of phases 2 and 3: the tip to a point below the grasp point."""
    return 1000.0 * _norm(scene.tip - _moved(scene.grasp_point, -BELOW, scene.retreat)).clamp_max(0.2)


def lift_leg(scene: Scene, lift_point: Tensor) -> Tensor:
    """Potential (N,) of phase 4: the part to the lift point."""
    offset = scene.part - lift_point
    return 500.0 * offset[:, 2].abs().clamp_max(0.5) + 250.0 * _norm(offset[:, :2]).clamp_max(0.8)


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
    at_start = _norm(scene.tip - start_tip) < 0.03
    above = _norm(scene.tip - _moved(scene.grasp_point, ABOVE, scene.retreat)) < 0.03
    depth = (to_lower * scene.retreat).sum(-1, keepdim=True)
    beside = _norm(to_lower - depth * scene.retreat)
    lowered = (beside < 0.02) & (depth.squeeze(-1).abs() < 0.015)
    held = scene.touching & (((scene.tip - scene.grasp_point) * scene.retreat).sum(-1) < 0)
    lifted = (to_lift[:, 2].abs() < 0.02) & (_norm(to_lift[:, :2]) < 0.05)
    return torch.stack(
        [
            at_start & down & hand_open,
            above & gripping & hand_open,
            lowered & gripping & hand_open,
            held & gripping,
            lifted & gripping,
            (_norm(to_lift) < 0.2) & upright,
            (_fine_distance(scene, z_finedist) < 0.06) & upright,
            connected,
        ],
        dim=-1,
    )


def off_ground(scene: Scene, lift_point: Tensor, rise: Tensor) -> Tensor:
    """Whether the part is a centimetre above where it lay, (N,) bool; the lift point is `rise` (N,), m, above that."""
    return scene.part[:, 2] - lift_point[:, 2] > OFF_GROUND - rise


def grip_penalty(scene: Scene, phase: Tensor) -> Tensor:
    """Reward (at most 0) for the hand's axes while a part is taken, (N,)."""
    tilt = 4.0 * ((scene.approach * scene.grip_direction).sum(-1) - 1) * (phase <= 4)
    turn = 2.0 * ((scene.closing * scene.grasp_axis).sum(-1).abs() - 1) * ((phase >= 1) & (phase <= 4))
    return tilt + turn


def _fine_distance(scene: Scene, z_finedist: float) -> Tensor:
    return _norm(scene.moving_connector - _moved(scene.target_connector, z_finedist, scene.way_out))


def _moved(point: Tensor, by: float, direction: Tensor) -> Tensor:
    return point + by * direction


def reward(task: Assembly, before, scene: Scene, action: Tensor, connected: Tensor) -> Tensor:
    """Reward (N,) of the step from the episode state `before` to `scene`, skipped phases being paid."""
    bonuses = BONUS * torch.tensor(BONUS_SHARES, dtype=torch.float64)
    remaining = bonuses.flip(0).cumsum(0).flip(0)
    lift, start, z = before["lift_point"], before["start_tip"], task.tables.z_finedist
    phase, grip = before["phase"], action[:, 7]
    fall = (
        (before["potential"] - potentials(scene, start, lift, z)).gather(-1, phase.unsqueeze(-1)).squeeze(-1)
    )
    lost = (phase >= 4) & ~scene.touching & ~connected
    difference = DIFFERENCE_SCALE * torch.where(lost, fall.clamp_max(0), fall)
    difference = difference + 200.0 * (grip - before["grip_action"]) * (phase == 3)
    met = conditions(scene, start, lift, z, grip < 0, connected)
    done = met.gather(-1, phase.unsqueeze(-1)).squeeze(-1) | connected
    paid = torch.where(connected, remaining[phase], bonuses[phase]) * done
    rise = task.tables.waypoint[task.tables.step_index(before["subtask"]), 2]
    raised = ~before["half_paid"] & (phase == 4) & off_ground(scene, lift, rise)
    raised = raised | (~before["half_paid"] & connected & (phase <= 4))
    asking = 10.0 * (action[:, 8] + 1) * ((phase == 7) & scene.alignment.aligned & ~connected)
    bonus = paid + 0.5 * bonuses[4] * raised + asking - before["asked"] * connected
    moved = _norm(scene.target_connector - before["start_target"])
    always = torch.where(phase <= 2, -grip, grip) - 0.001 * action[:, :7].norm(dim=-1) - 50.0 * moved
    return difference + bonus + (always + grip_penalty(scene, phase) - 20.0 * lost)


def alignment(task: Assembly, scene: Scene, subtask: Tensor) -> Alignment:
    """How connectors lie, from their axes."""

    def axes(frame: str) -> Tensor:
        y, z = (scene.vector(f"{frame}.{axis}") for axis in "yz")
        return torch.stack([torch.linalg.cross(y, z), y, z], dim=-1)

    angles = task.tables.allowed_angles[task.tables.step_index(subtask)]
    target = axes("target")
    target[..., 0] = scene.vector("target.x")
    return align(scene.moving_connector, axes("moving"), scene.target_connector, target, angles)
