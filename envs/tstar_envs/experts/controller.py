"""Differential inverse kinematics: a hand twist to joint velocities, and these to the seven actions of the arm."""

from __future__ import annotations

import torch
from torch import Tensor

DAMPING = 0.003


def joint_velocities(anchors: Tensor, axes: Tensor, point: Tensor, twist: Tensor) -> Tensor:
    """Damped least squares joint velocities, (N, J) rad/s.

    Args:
        anchors, axes: (N, J, 3), m, world: where each joint is and what it turns about.
        point: (N, 3), m, world: the point whose linear velocity `twist` gives.
        twist: (N, 6): linear (m/s) and angular (rad/s) velocity of the hand, world.
    """
    linear = torch.linalg.cross(axes, point.unsqueeze(1) - anchors)
    jacobian = torch.cat([linear, axes], dim=-1).transpose(1, 2)  # (N, 6, J)
    damping = DAMPING**2 * torch.eye(6, dtype=twist.dtype, device=twist.device)
    weights = torch.linalg.solve(jacobian @ jacobian.transpose(1, 2) + damping, twist.unsqueeze(-1))
    return (jacobian.transpose(1, 2) @ weights).squeeze(-1)


def arm_action(velocities: Tensor, limits: Tensor) -> Tensor:
    """Actions in [-1, 1], (N, J): the velocities as shares of `limits`, slowed together where one is too fast."""
    action = velocities / limits
    return action / action.abs().amax(dim=-1, keepdim=True).clamp_min(1.0)


def rotation_vector(current: Tensor, goal: Tensor) -> Tensor:
    """The turn (axis times angle, rad, world) from frames `current` to `goal`, (N, 3, 3) each."""
    turn = goal @ current.transpose(1, 2)
    skew = torch.stack(
        [turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], dim=-1
    )
    sine = skew.norm(dim=-1, keepdim=True) / 2
    cosine = (turn.diagonal(dim1=1, dim2=2).sum(-1, keepdim=True) - 1) / 2
    vector = skew / (2 * sine.clamp_min(1e-9)) * torch.atan2(sine, cosine)
    half = (sine < 1e-6) & (cosine < 0)
    if bool(half.any()):  # then the axis is in the symmetric part alone, and its sign means nothing
        columns = turn + torch.eye(3, dtype=turn.dtype, device=turn.device)
        longest = columns.norm(dim=1).argmax(-1)
        axis = torch.nn.functional.normalize(columns[torch.arange(len(turn)), :, longest], dim=-1)
        vector = torch.where(half, torch.pi * axis, vector)
    return vector


def clip_norm(vector: Tensor, limit: float) -> Tensor:
    """Vectors (N, D) shortened to at most `limit`."""
    return vector * (limit / vector.norm(dim=-1, keepdim=True).clamp_min(1e-9)).clamp_max(1.0)
