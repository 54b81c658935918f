"""When two connectors are aligned, which connections are wrong, and how a weld is made.

Source: environment.md, "Connecting".
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from tstar_envs import geometry
from tstar_envs.furniture.schema import Furniture

MAX_DISTANCE = 0.02
MIN_UP_COSINE = 0.99
MIN_FORWARD_COSINE = 0.99


class Alignment(NamedTuple):
    """How one connector lies to another; every field (N,)."""

    distance: Tensor  # m
    up_cosine: Tensor  # of the z axes
    forward_cosine: Tensor  # of the y axes, for the best allowed turn about z
    moving_projection: Tensor  # cosine of the moving z axis with the line to the target connector
    target_projection: Tensor

    @property
    def aligned(self) -> Tensor:
        """(N,) bool: the connection rule. The original's projection threshold of 0 always holds."""
        return (
            (self.distance < MAX_DISTANCE)
            & (self.up_cosine > MIN_UP_COSINE)
            & (self.forward_cosine > MIN_FORWARD_COSINE)
        )


def align(
    moving_pos: Tensor, moving_axes: Tensor, target_pos: Tensor, target_axes: Tensor, allowed_angles: Tensor
) -> Alignment:
    """Compares two connectors.

    Args:
        moving_pos, target_pos: (N, 3), m, world.
        moving_axes, target_axes: (N, 3, 3), world; columns x, y (forward) and z (up).
        allowed_angles: (N, R), rad, turns about z that count as forward-aligned.
    """
    offset = target_pos - moving_pos
    distance = offset.norm(dim=-1)
    line = offset / distance.clamp_min(1e-9).unsqueeze(-1)
    cosines = moving_axes.transpose(-1, -2) @ target_axes
    forward = allowed_angles.cos() * cosines[:, 1, 1:2] - allowed_angles.sin() * cosines[:, 1, 0:1]
    return Alignment(
        distance,
        cosines[:, 2, 2],
        forward.amax(dim=-1),
        (moving_axes[:, :, 2] * line).sum(-1),
        (target_axes[:, :, 2] * line).sum(-1),
    )


def padded(angles: Iterable[tuple[float, ...]]) -> list[tuple[float, ...]]:
    """Rows of allowed angles (rad), short ones filled up by repeating their first."""
    rows = list(angles)
    width = max(len(row) for row in rows)
    return [row + (row[0],) * (width - len(row)) for row in rows]


class WrongPairs:
    """Every pair of connectors that could mate but is not the step's own, to fail a wrong connection."""

    def __init__(self, furniture: Furniture, device: torch.device):
        names = [part.name for part in furniture.parts]
        listed = [(names.index(p.name), c) for p in furniture.parts for c in p.connectors]
        pairs = [
            (a, ca, b, cb)
            for a, ca in listed
            for b, cb in listed
            if a != b and ca.kind == cb.mates_with and cb.kind == ca.mates_with and ca.allowed_angles
        ]
        self.count = len(pairs)
        self.first = torch.tensor([p[0] for p in pairs], dtype=torch.long, device=device)
        self.second = torch.tensor([p[2] for p in pairs], dtype=torch.long, device=device)

        def rows(values: Iterable[Sequence[float]]) -> Tensor:
            return torch.tensor(list(values), dtype=torch.float64, device=device)

        self.first_pos, self.second_pos = rows(p[1].pos for p in pairs), rows(p[3].pos for p in pairs)
        self.first_quat, self.second_quat = rows(p[1].quat for p in pairs), rows(p[3].quat for p in pairs)
        self.angles = rows(padded(p[1].allowed_angles for p in pairs))
        step_pairs = [
            {(s.moving_part, s.moving_connector), (s.target_part, s.target_connector)}
            for s in furniture.steps
        ]
        self.allowed = torch.tensor(  # (K, P): made by step k or, being welded already, by one before it
            [
                [{(names[a], ca.name), (names[b], cb.name)} in step_pairs[: k + 1] for a, ca, b, cb in pairs]
                for k in range(len(step_pairs))
            ],
            dtype=torch.bool, device=device,
        )  # fmt: skip

    def made(self, part_poses: Tensor, held: Tensor, subtask: Tensor) -> Tensor:
        """(n,) bool: a held part is aligned with a connector that is not its own.

        Args:
            part_poses: (n, parts, 7), world. held: (n, parts) bool, touched by both fingers. subtask: (n,).
        """
        n = part_poses.shape[0]
        poses = [part_poses[:, index].reshape(n * self.count, 7) for index in (self.first, self.second)]
        ends = []
        for pose, pos, quat in zip(
            poses, (self.first_pos, self.second_pos), (self.first_quat, self.second_quat), strict=True
        ):
            point = pose[:, :3] + geometry.quat_rotate(pose[:, 3:], pos.repeat(n, 1))
            ends += [point, geometry.quat_to_matrix(geometry.quat_mul(pose[:, 3:], quat.repeat(n, 1)))]
        aligned = align(*ends, self.angles.repeat(n, 1)).aligned.reshape(n, self.count)
        return (aligned & held[:, self.first] & ~self.allowed[subtask]).any(-1)
