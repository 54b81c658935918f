"""When two connectors are aligned, and which connections are wrong.

Source: docs/task.md, "Connection".
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from tstar_envs import geometry
from tstar_envs.furniture.schema import Furniture

MAX_DISTANCE = 0.02
MIN_UP_COSINE = 0.99
MIN_FORWARD_COSINE = 0.99
ALIGNED = ((-math.inf, MAX_DISTANCE), (MIN_FORWARD_COSINE, math.inf), (MIN_UP_COSINE, math.inf))
"""The connection rule as bounds, which are excluded: of distance, forward and up cosine."""


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
        fields = self.distance, self.forward_cosine, self.up_cosine
        held = [
            (least < field) & (field < most) for field, (least, most) in zip(fields, ALIGNED, strict=True)
        ]
        return held[0] & held[1] & held[2]


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
    distance = offset.square().sum(-1).sqrt()
    line = offset / distance.clamp_min(1e-9).unsqueeze(-1)
    (_, forward, up), (across, along, above) = moving_axes.unbind(-1), target_axes.unbind(-1)
    turned = allowed_angles.cos() * _dot(forward, along) - allowed_angles.sin() * _dot(forward, across)
    return Alignment(
        distance,
        _dot(up, above).squeeze(-1),
        turned.amax(dim=-1),
        _dot(up, line).squeeze(-1),
        _dot(above, line).squeeze(-1),
    )


def _dot(a: Tensor, b: Tensor) -> Tensor:
    return (a * b).sum(-1, keepdim=True)


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
            (i, j)
            for i, (a, ca) in enumerate(listed)
            for j, (b, cb) in enumerate(listed)
            if a != b and ca.kind == cb.mates_with and cb.kind == ca.mates_with and ca.allowed_angles
        ]

        def rows(values: Iterable[Sequence[float]]) -> Tensor:
            return torch.tensor(list(values), dtype=torch.float64, device=device)

        self.part = torch.tensor([part for part, _ in listed], device=device)  # of each connector, (C,)
        self.pos, self.quat = rows(c.pos for _, c in listed), rows(c.quat for _, c in listed)
        self.first = torch.tensor([i for i, _ in pairs], dtype=torch.long, device=device)  # connectors, (P,)
        self.second = torch.tensor([j for _, j in pairs], dtype=torch.long, device=device)
        self.angles = rows(padded(listed[i][1].allowed_angles for i, _ in pairs))
        step_pairs = [
            {(s.moving_part, s.moving_connector), (s.target_part, s.target_connector)}
            for s in furniture.steps
        ]
        ends = [(names[part], connector.name) for part, connector in listed]
        self.pairs = [(".".join(ends[i]), ".".join(ends[j])) for i, j in pairs]
        self.allowed = torch.tensor(  # (K, P): made by step k or, being welded already, by one before it
            [[{ends[i], ends[j]} in step_pairs[: k + 1] for i, j in pairs] for k in range(len(step_pairs))],
            dtype=torch.bool, device=device,
        )  # fmt: skip

    def made(self, part_poses: Tensor, held: Tensor, subtask: Tensor) -> Tensor:
        """(n,) bool: a held part is aligned with a connector that is not its own; takes what `which` does."""
        return self.which(part_poses, held, subtask).any(-1)

    def which(self, part_poses: Tensor, held: Tensor, subtask: Tensor) -> Tensor:
        """(n, P) bool: by which of the `pairs` a held part is aligned with a connector that is not its own.

        Args:
            part_poses: (n, parts, 7), world. held: (n, parts) bool, touched by both fingers. subtask: (n,).
        """
        poses = part_poses[:, self.part]
        points = poses[..., :3] + geometry.quat_rotate(poses[..., 3:], self.pos)
        apart = points[:, self.second] - points[:, self.first]
        wrong = held[:, self.part[self.first]] & ~self.allowed[subtask]
        wrong &= apart.square().sum(-1) < MAX_DISTANCE**2
        if not bool(wrong.any()):  # as good as always: the axes need not be looked at
            return wrong
        frames = geometry.quat_to_matrix(
            geometry.quat_mul(poses[..., 3:], self.quat.expand(len(poses), -1, -1))
        )
        ends = [x[:, i].flatten(0, 1) for i in (self.first, self.second) for x in (points, frames)]
        aligned = align(*ends, self.angles.repeat(len(poses), 1)).aligned
        return wrong & aligned.reshape(wrong.shape)
