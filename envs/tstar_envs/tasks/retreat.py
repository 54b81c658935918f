"""How the hand lets go of a part that was just joined and draws back, where nobody puts the arm back home.

Source: docs/task.md, "Connection".
"""

from __future__ import annotations

import torch
from torch import Tensor

from tstar_envs.physics.masks import write
from tstar_envs.physics.view import PhysicsView
from tstar_envs.robots import sawyer
from tstar_envs.scene import SUBSTEPS

RATE = 4.0
"""Proportional gain of the joints on their way, 1/s."""


def draw_back(physics: PhysicsView, home: Tensor, speeds: Tensor, steps: int, mask: Tensor) -> Tensor:
    """Opens the gripper for one control step, then moves the joints of `mask` straight towards home.

    The arm can meet parts on its way, and push them. At the end it is told to stand still.

    Args:
        physics: the simulations.
        home: (9,), joints (rad) and open fingers (m).
        speeds: (7,), rad/s, the fastest that each joint may turn.
        steps: control steps, the first among them.
        mask: (N,) bool.

    Returns:
        (N,) bool, the simulations of `mask` that failed.
    """
    arm, fingers = physics.ctrl[:, : sawyer.NUM_JOINTS], physics.ctrl[:, sawyer.NUM_JOINTS :]
    joints, goal = physics.qpos[:, : sawyer.NUM_JOINTS], home[: sawyer.NUM_JOINTS]
    still, failed = torch.zeros_like(arm), torch.zeros_like(mask)
    write(fingers, home[sawyer.NUM_JOINTS :].expand_as(fingers), mask)
    for step in range(steps):
        write(arm, velocities_to(goal, joints, speeds) if step else still, mask)
        failed |= physics.step(SUBSTEPS, mask)
    write(arm, still, mask)
    return failed


def velocities_to(goal: Tensor, joints: Tensor, speeds: Tensor) -> Tensor:
    """Joint velocities (n, 7), rad/s, straight towards `goal` (7,) from `joints` (n, 7), none beyond `speeds` (7,)."""
    velocity = RATE * (goal - joints)
    return velocity / (velocity.abs() / speeds).amax(-1, keepdim=True).clamp_min(1.0)


def joint_speeds(scale: float, device: torch.device) -> Tensor:
    """The fastest that each joint may turn, (7,) float64, rad/s, where the setting velocity_scale is `scale`."""
    return scale * torch.tensor(sawyer.JOINT_SPEEDS, dtype=torch.float64, device=device)
