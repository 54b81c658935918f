"""The assembly recipe as tensors, one row per step, so that a batch of simulations can be at different steps."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import torch
from torch import Tensor

from tstar_envs import geometry
from tstar_envs.connection import padded
from tstar_envs.furniture.schema import Connector, Furniture, Part, Step
from tstar_envs.furniture.shapes import Vec3

_HALF_A_TURN = 1e-6
"""Two quaternions whose product is nearer to 0 than this are half a turn apart."""
_LEVEL = 1e-9
"""m: a connector no further from the plane of a body's middle is in it."""
_ASTRAY = 0.25
"""Of the longest shape of a part: a frame that far from the centre of mass does not stand in the part's middle."""


class RecipeTables:
    """Rows (K, ...) of what each step needs, float64; index with the subtask of each simulation, (N,)."""

    def __init__(self, furniture: Furniture, device: torch.device):
        steps = range(len(furniture.steps))
        connectors = [furniture.connectors_of(k) for k in steps]
        grasps = [furniture.grasp_of(k) for k in steps]
        parts = [furniture.part(step.moving_part) for step in furniture.steps]

        def rows(values: Iterable[Sequence[float] | float]) -> Tensor:
            return torch.tensor(list(values), dtype=torch.float64, device=device)

        self.name = furniture.name
        self.num_steps, self.num_parts = len(furniture.steps), len(furniture.parts)
        self.moving = _part_indices(furniture, [step.moving_part for step in furniture.steps], device)
        self.target = _part_indices(furniture, [step.target_part for step in furniture.steps], device)
        self.moving_connector = rows([*moving.pos, *moving.quat] for moving, _ in connectors)
        self.target_connector = rows([*target.pos, *target.quat] for _, target in connectors)
        self.moving_frame = geometry.quat_to_matrix(self.moving_connector[:, 3:])
        self.target_frame = geometry.quat_to_matrix(self.target_connector[:, 3:])
        self.grasp_point = rows(grasp.point for grasp in grasps)
        self.grasp_axis = rows(grasp.axis for grasp in grasps)
        self.grip_direction = rows(step.grip_angle for step in furniture.steps)
        self.retreat = rows(_retreat(step) for step in furniture.steps)
        """(K, 3), world: the way from the grasp point to where the hand waits before it grasps."""
        self.follows_axis = torch.tensor([[s.approach == "axis"] for s in furniture.steps], device=device)
        """(K, 1): whether the moving connector comes along the target's axis, not from straight above."""
        self.side = rows(_side(part, moving) for part, (moving, _) in zip(parts, connectors, strict=True))
        """(K,): 1 where the moving part's body comes to lie over the target connector, along its up axis; -1: under."""
        self.way_out = self.side.unsqueeze(-1) * self.target_frame[:, :, 2]
        """(K, 3), target part's frame: away from the target connector, where the moving one comes from."""
        self.middle = rows(_middle(part) for part in parts)
        """(K, 3), moving part's frame: what the script lifts and turns the part about."""
        self.insertion = rows(step.insertion for step in furniture.steps)
        self.clearance = rows(step.clearance for step in furniture.steps)
        self.travel_height = rows(step.travel_height for step in furniture.steps)
        self.turn_height = rows(step.turn_height for step in furniture.steps)
        self.turns_freely = torch.tensor([moving.turns_freely for moving, _ in connectors], device=device)
        self.waypoint = rows(step.waypoint for step in furniture.steps)
        angles = rows(step.angle for step in furniture.steps)
        self.goal_quat = geometry.quat_mul(self.target_connector[:, 3:], geometry.yaw_quat(angles))
        """(K, 4): the moving connector's frame in the target part's frame when the step is made exactly."""
        self.goal_frame = geometry.quat_to_matrix(self.goal_quat)
        self.allowed_angles = rows(padded(moving.allowed_angles for moving, _ in connectors))
        self.z_finedist = furniture.z_finedist
        self.group = _groups(self.moving, self.target, self.num_parts)
        self.initial_pose = rows(part.initial_pose for part in furniture.parts)
        self._ideal, self._nominal = self._assembled()

    def step_index(self, subtask: Tensor) -> Tensor:
        """(N,): which row of the tables each simulation is at; the last one once everything is done."""
        return subtask.clamp_max(self.num_steps - 1)

    def ideal_relative_pose(self, step: int) -> Tensor:
        """Pose (7,) of the moving part in the target part's frame when step `step` is made exactly.

        The quaternion's sign continues that of the pose in which the step finds the part, as physics does. A part that
        ends half a turn from there could have come either way round; there the sign of the step's angle says which.
        """
        return self._ideal[step]

    def nominal_poses(self) -> Tensor:
        """Part poses (K + 1, parts, 7), world, as each step begins and after the last: no noise, every step exact."""
        return self._nominal

    def _assembled(self) -> tuple[list[Tensor], Tensor]:
        """What `ideal_relative_pose` gives of each step, and `nominal_poses`."""
        ideals, poses = [], [self.initial_pose.unsqueeze(0)]
        for k in range(self.num_steps):
            ideals.append(self._joined(k, poses[-1][0]))
            target, ideal = poses[-1][:, self.target[k]], ideals[-1]
            pose = geometry.compose_pose(target[:, :3], target[:, 3:], ideal[:3], ideal[3:].unsqueeze(0))
            poses.append(self.move_group(k, poses[-1], torch.cat(pose, dim=-1)))
        return ideals, torch.cat(poses)

    def _joined(self, step: int, poses: Tensor) -> Tensor:
        """`ideal_relative_pose` of a step that finds the parts at `poses` (parts, 7)."""
        quat = geometry.quat_mul(self.goal_quat[step], geometry.quat_conj(self.moving_connector[step, 3:]))
        pos = self.target_connector[step, :3] - geometry.quat_rotate(quat, self.moving_connector[step, :3])
        made = geometry.quat_mul(poses[self.target[step], 3:], quat)
        sign = torch.where(made @ poses[self.moving[step], 3:] < -_HALF_A_TURN, -1.0, 1.0)
        return torch.cat([pos, quat * sign])

    def move_group(self, step: int, poses: Tensor, pose: Tensor) -> Tensor:
        """Brings the moving part of `step` to `pose` (N, 7), and what is welded to it along: `poses` (N, parts, 7)."""
        old, poses = poses[:, self.moving[step]], poses.clone()
        for i in self.group[step].nonzero().flatten().tolist():
            pos, quat = geometry.relative_pose(old[:, :3], old[:, 3:], poses[:, i, :3], poses[:, i, 3:])
            poses[:, i] = torch.cat(geometry.compose_pose(pose[:, :3], pose[:, 3:], pos, quat), dim=-1)
        return poses

    def approach_direction(self, step: Tensor, target_frame: Tensor) -> Tensor:
        """(N, 3), world: from the target connector to where the moving one comes from, at steps (N,).

        `target_frame` is (N, 3, 3), the target part's axes in the world.
        """
        along = (target_frame @ self.way_out[step].unsqueeze(-1)).squeeze(-1)
        return torch.where(self.follows_axis[step], along, along.new_tensor([0.0, 0.0, 1.0]))


def _retreat(step: Step) -> Sequence[float]:
    return (0.0, 0.0, 1.0) if step.grasp_from == "above" else [-x for x in step.grip_angle]


def _side(part: Part, connector: Connector) -> float:
    """-1 if the part's body lies under its connector, along the connector's up axis; else 1.

    By its centre of mass: a part's frame may stand anywhere, also at the connector.
    """
    up = geometry.up_axis(torch.tensor(connector.quat, dtype=torch.float64)).tolist()
    height = sum(u * (c - m) for u, c, m in zip(up, connector.pos, part.centre_of_mass, strict=True))
    return -1.0 if height > _LEVEL else 1.0


def _middle(part: Part) -> Vec3:
    """The frame's origin, as pieces have it in a part's middle; the centre of mass where the frame stands elsewhere."""
    centre, length = part.centre_of_mass, max(shape.extent for shape in part.shapes)
    return centre if math.hypot(*centre) > _ASTRAY * length else (0.0, 0.0, 0.0)


def _part_indices(furniture: Furniture, names: list[str], device: torch.device) -> Tensor:
    return torch.tensor([furniture.part_index(name) for name in names], device=device)


def _groups(moving: Tensor, target: Tensor, num_parts: int) -> Tensor:
    """(K, num_parts): parts that move with step k's moving part, welded to it by the steps before k."""
    groups = torch.zeros(len(moving), num_parts, dtype=torch.bool, device=moving.device)
    for k in range(len(moving)):
        members = {int(moving[k])}
        for _ in range(k):
            for j in range(k):
                pair = {int(moving[j]), int(target[j])}
                if pair & members:
                    members |= pair
        groups[k, list(members)] = True
    return groups
