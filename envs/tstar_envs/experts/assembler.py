"""The scripted assembly policy: what to do next is read off the scene alone, so it can start from any state.

Reach over the part, lower, close, lift, turn the connector upright over the target, lower finely, connect. It acts
through the same nine actions as any policy. Source: docs/task.md, "Expert".
"""

from __future__ import annotations

import torch
from tensordict import TensorDict
from torch import Tensor

from tstar_envs import geometry
from tstar_envs.experts import controller
from tstar_envs.physics.view import PhysicsView
from tstar_envs.robots import sawyer
from tstar_envs.tasks.actions import CONNECT, GRIPPER, NUM_ACTIONS
from tstar_envs.tasks.assembly import Assembly
from tstar_envs.tasks.scene_reader import Scene

RATE = 6.0
"""Proportional gain, 1/s: at 10 Hz a step closes 60% of an error."""
MAX_SPEED, MAX_TURN = 0.4, 1.4
"""Limits of the hand, m/s and rad/s: turning a held part faster loses it."""
HOVER, APPROACH = 0.06, 0.03
"""Heights, m: the hand over the grasp point, the connector over its target before it is lowered."""
SLACK = 2.0
"""How much further off a lowering may be near its end than at its beginning, before it is given up."""
GRASP_DEPTH = 0.008
"""How far below the grasp point the tip goes, m."""


class Assembler:
    """Scripted expert for the simulations of a task."""

    def __init__(self, task: Assembly, physics: PhysicsView):
        self.task, self.physics = task, physics
        self.limits = task.settings.velocity_scale * torch.tensor(
            sawyer.JOINT_SPEEDS, dtype=torch.float64, device=physics.device
        )
        self._anchors, self._axes = physics.joint_frames(sawyer.NUM_JOINTS)

    def act(self, state: TensorDict) -> Tensor:
        """Actions (N, 9) for the present scene."""
        scene = self.task.scene(state)
        hand = torch.stack(
            [torch.linalg.cross(scene.closing, scene.approach), scene.closing, scene.approach], dim=-1
        )
        reach, close = self._reach(scene, hand)
        carry, connect = self._carry(state, scene)
        holding = scene.touching.unsqueeze(-1)
        twist = torch.where(holding, carry, reach)
        velocity = controller.joint_velocities(self._anchors, self._axes, scene.tip, twist)
        action = velocity.new_empty(velocity.shape[0], NUM_ACTIONS)
        action[:, :GRIPPER] = controller.arm_action(velocity, self.limits)
        action[:, GRIPPER] = torch.where(scene.touching | close, 1.0, -1.0)
        action[:, CONNECT] = torch.where(scene.touching & connect, 1.0, -1.0)
        return action

    def _reach(self, scene: Scene, hand: Tensor) -> tuple[Tensor, Tensor]:
        """Twist (N, 6) towards the grasp, and whether to close, (N,) bool."""
        side = (scene.grasp_axis * scene.closing).sum(-1, keepdim=True).sign()
        along = (scene.grasp_axis * scene.grip_direction).sum(-1, keepdim=True)
        level = scene.grasp_axis - scene.grip_direction * along
        closing = torch.nn.functional.normalize(level * side, dim=-1)
        goal = torch.stack(
            [torch.linalg.cross(closing, scene.grip_direction), closing, scene.grip_direction], dim=-1
        )
        turn = controller.rotation_vector(hand, goal)
        offset = scene.grasp_point - scene.tip
        slack = _slack(-offset[:, 2], HOVER)
        ready = (offset[:, :2].norm(dim=-1) < 0.012 * slack) & (turn.norm(dim=-1) < 0.12 * slack)
        depth = torch.where(ready, -GRASP_DEPTH, HOVER)
        offset = torch.cat([offset[:, :2], offset[:, 2:] + depth.unsqueeze(-1)], dim=-1)
        close = ready & (offset[:, 2].abs() < 0.006)
        return self._twist(offset, turn, close), close

    def _carry(self, state: TensorDict, scene: Scene) -> tuple[Tensor, Tensor]:
        """Twist (N, 6) that brings the held part to its target, and whether to connect, (N,) bool."""
        moving, goal = self._connector_frames(state)
        turn = controller.rotation_vector(moving, goal)
        to_target = scene.target_connector - scene.moving_connector
        upright = turn.norm(dim=-1) < 0.25
        slack = _slack(-to_target[:, 2], APPROACH)
        over = upright & (to_target[:, :2].norm(dim=-1) < 0.015 * slack) & (turn.norm(dim=-1) < 0.06 * slack)
        height = torch.where(over, 0.0, APPROACH)
        above = torch.cat([to_target[:, :2], to_target[:, 2:] + height.unsqueeze(-1)], dim=-1)
        # Not yet upright: up first, on the spot, then turn about the part's own middle.
        lift = scene.part.new_zeros(scene.part.shape)
        lift[:, 2] = self._carry_height(state, scene) - scene.part[:, 2]
        high = lift[:, 2] < 0.06
        about = torch.where(upright.unsqueeze(-1), scene.moving_connector, scene.part)
        offset = torch.where(upright.unsqueeze(-1), above, lift)
        turn = torch.where((high | upright).unsqueeze(-1), turn, torch.zeros_like(turn))
        twist = self._twist(offset, turn, torch.zeros_like(high))
        lever = torch.linalg.cross(twist[:, 3:], scene.tip - about)
        alignment = scene.alignment
        connect = (
            (alignment.distance < 0.008) & (alignment.up_cosine > 0.995) & (alignment.forward_cosine > 0.995)
        )
        return torch.cat([twist[:, :3] + lever, twist[:, 3:]], dim=-1), connect

    def _carry_height(self, state: TensorDict, scene: Scene) -> Tensor:
        """Height of the part's middle at which it can be turned upright clear of everything, m, (N,)."""
        length = (scene.moving_connector - scene.part).norm(dim=-1)
        return scene.target_connector[:, 2] + length + APPROACH + 0.01

    def _connector_frames(self, state: TensorDict) -> tuple[Tensor, Tensor]:
        """World frames (N, 3, 3) of the moving connector and of its goal, at the turn that the recipe names."""
        tables = self.task.tables
        k = tables.step_index(state["subtask"])
        poses, rows = self.task.part_poses, torch.arange(self.physics.num_sims, device=self.physics.device)
        moving = geometry.quat_to_matrix(poses[rows, tables.moving[k], 3:]) @ tables.moving_frame[k]
        return moving, geometry.quat_to_matrix(poses[rows, tables.target[k], 3:]) @ tables.goal_frame[k]

    def _twist(self, offset: Tensor, turn: Tensor, still: Tensor) -> Tensor:
        linear = controller.clip_norm(RATE * offset, MAX_SPEED)
        angular = controller.clip_norm(RATE * turn, MAX_TURN)
        return torch.cat([linear, angular], dim=-1) * (~still).unsqueeze(-1)


def _slack(height: Tensor, above: float) -> Tensor:
    """Tolerance (N,), 1 from `above` (m) upwards to `SLACK` at the goal: one jolt does not undo a lowering."""
    return 1 + (SLACK - 1) * (1 - height / above).clamp(0, 1)
