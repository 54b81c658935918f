"""The scripted assembly policy: what to do next is read off the scene alone, so it can start from any state.

Reach over the part, lower, close, lift, turn the connector upright over the target, lower finely, connect. It acts
through the same nine actions as any policy. Source: docs/task.md, "Expert".
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from tstar_envs import geometry
from tstar_envs.experts import controller
from tstar_envs.furniture.consistency import LEAST_TRAVEL
from tstar_envs.physics.view import PhysicsView
from tstar_envs.robots import sawyer
from tstar_envs.tasks.actions import CONNECT, GRIPPER, NUM_ACTIONS
from tstar_envs.tasks.assembly import Assembly
from tstar_envs.tasks.recipe_tables import RecipeTables
from tstar_envs.tasks.retreat import joint_speeds
from tstar_envs.tasks.scene_reader import Scene
from tstar_envs.tasks.task import EpisodeState

RATE = 6.0
"""Proportional gain, 1/s: at 10 Hz a step closes 60% of an error."""
MAX_SPEED, MAX_TURN = 0.4, 1.4
"""Limits of the point that is steered, m/s and rad/s: turning a held part faster loses it."""
HOVER, APPROACH = LEAST_TRAVEL, 0.03
"""Heights, m: the hand over the grasp point, the connector over its target before it is lowered."""
ASIDE = 0.015
"""How far beside its target, m, a connector may begin to be lowered."""
MOUTH, INSIDE = 0.012, 0.004
"""m: before the mouth of a socket a part waits to be in line with it; that deep in it, its walls hold it."""
INSERTION_STEP = 1.2
"""Furthest goal ahead of a part on its straight last stretch, in clearances: 72 mm/s with a centimetre of play."""
HALF_TURN, WRIST_RANGE = 2.2, 4.4
"""rad: a turn that is about as long the other way round; how far the wrist's last joint can go, with a margin."""
SLACK = 2.0
"""How much further off a lowering may be near its end than at its beginning, before it is given up."""
GRASP_DEPTH = 0.008
"""How far below the grasp point the tip goes, m."""


class Assembler:
    """Scripted expert for the simulations of a task."""

    def __init__(self, task: Assembly, physics: PhysicsView):
        self.task, self.physics = task, physics
        self.limits = joint_speeds(task.settings.velocity_scale, physics.device)
        self._anchors, self._axes = physics.joint_frames(sawyer.NUM_JOINTS)
        self._hand_in_connector = _hand_in_connector(task.tables)

    def act(self, state: EpisodeState) -> Tensor:
        """Actions (N, 9) for the present scene."""
        scene = self.task.scene(state)
        hand = torch.stack(
            [torch.linalg.cross(scene.closing, scene.approach), scene.closing, scene.approach], dim=-1
        )
        reach, close = self._reach(state, scene, hand)
        carry, connect = self._carry(state, scene, hand)
        holding = scene.touching.unsqueeze(-1)
        twist = torch.where(holding, carry, reach)
        velocity = controller.joint_velocities(self._anchors, self._axes, scene.tip, twist)
        action = velocity.new_empty(velocity.shape[0], NUM_ACTIONS)
        action[:, :GRIPPER] = controller.arm_action(velocity, self.limits)
        action[:, GRIPPER] = torch.where(scene.touching | close, 1.0, -1.0)
        action[:, CONNECT] = torch.where(scene.touching & connect, 1.0, -1.0)
        return action

    def _reach(self, state: EpisodeState, scene: Scene, hand: Tensor) -> tuple[Tensor, Tensor]:
        """Twist (N, 6) towards the grasp, and whether to close, (N,) bool."""
        side = torch.where((scene.grasp_axis * scene.closing).sum(-1, keepdim=True) < 0, -1.0, 1.0)
        along = (scene.grasp_axis * scene.grip_direction).sum(-1, keepdim=True)
        level = scene.grasp_axis - scene.grip_direction * along
        closing = torch.nn.functional.normalize(level * side, dim=-1)
        goal = torch.stack(
            [torch.linalg.cross(closing, scene.grip_direction), closing, scene.grip_direction], dim=-1
        )
        turn = self._wrist_turn(hand, controller.rotation_vector(hand, goal))
        depth, beside = _split(scene.grasp_point - scene.tip, scene.retreat)
        slack = _slack(-depth, HOVER)
        ready = (beside.norm(dim=-1) < 0.012 * slack) & (turn.norm(dim=-1) < 0.12 * slack)
        farther = self._waits_farther_off(state, scene, beside, turn)
        off = depth + torch.where(ready, -GRASP_DEPTH, HOVER) + torch.where(ready, 0.0, farther)
        close = ready & (off.abs() < 0.006)
        from_above = scene.retreat[:, 2] > 0.99
        low = (
            ~ready & (off > 0.03) & from_above & (self._travel_height(state) > HOVER)
        )  # up first, then there
        beside = torch.where(low.unsqueeze(-1), 0.0, beside)
        return self._twist(beside + off.unsqueeze(-1) * scene.retreat, turn, close), close

    def _waits_farther_off(self, state: EpisodeState, scene: Scene, beside: Tensor, turn: Tensor) -> Tensor:
        """How much farther than `HOVER` off the grasp point the hand waits, m, (N,), while it travels or turns."""
        far = ((beside.norm(dim=-1) - 0.03) / 0.05).clamp(0.0, 1.0)
        travels = (self._travel_height(state) - HOVER) * far
        turns = 0.1 * (turn.norm(dim=-1) / 0.5).clamp_max(1.0)
        return torch.where(scene.retreat[:, 2] > 0.99, travels, turns)

    def _travel_height(self, state: EpisodeState) -> Tensor:
        return self.task.tables.travel_height[self.task.tables.step_index(state["subtask"])]

    def _carry(self, state: EpisodeState, scene: Scene, hand: Tensor) -> tuple[Tensor, Tensor]:
        """Twist (N, 6) that brings the held part to its target, and whether to connect, (N,) bool."""
        moving, goal = self._connector_frames(state, scene.approach)
        turn = self._wrist_turn(hand, controller.rotation_vector(moving, goal))
        height, beside = _split(scene.target_connector - scene.moving_connector, scene.way_out)
        upright = turn.norm(dim=-1) < 0.25
        straight = self._straight_way(state, height, beside, turn)
        slack = _slack(-height, APPROACH)
        over = upright & (beside.norm(dim=-1) < ASIDE * slack) & (turn.norm(dim=-1) < 0.06 * slack)
        before = height + torch.where(over, 0.0, APPROACH)
        above = beside + before.unsqueeze(-1) * scene.way_out
        above = torch.where(straight.is_one.unsqueeze(-1), straight.goal(beside, scene.way_out), above)
        # Not yet upright: up first, on the spot, then turn about the part's own middle.
        middle = self._middle(state, scene)
        lift = torch.zeros_like(middle)
        lift[:, 2] = self._carry_height(state, scene, middle) - middle[:, 2]
        high = lift[:, 2] < 0.06
        about = torch.where(upright.unsqueeze(-1), scene.moving_connector, middle)
        offset = torch.where(upright.unsqueeze(-1), above, lift)
        turn = torch.where((high | upright).unsqueeze(-1), turn, torch.zeros_like(turn))
        twist = self._twist(offset, turn, torch.zeros_like(high))
        lever = torch.linalg.cross(twist[:, 3:], scene.tip - about)
        alignment = scene.alignment
        connect = (
            (alignment.distance < 0.008) & (alignment.up_cosine > 0.995) & (alignment.forward_cosine > 0.995)
        )
        return torch.cat([twist[:, :3] + lever, twist[:, 3:]], dim=-1), connect

    def _middle(self, state: EpisodeState, scene: Scene) -> Tensor:
        """The moving part's middle, m, world, (N, 3)."""
        tables, k = self.task.tables, self.task.tables.step_index(state["subtask"])
        turned = self.task.part_poses[torch.arange(len(k), device=k.device), tables.moving[k], 3:]
        return scene.part + geometry.quat_rotate(turned, tables.middle[k])

    def _carry_height(self, state: EpisodeState, scene: Scene, middle: Tensor) -> Tensor:
        """Height of the part's middle at which it can be turned upright clear of everything, m, (N,)."""
        length = (scene.moving_connector - middle).norm(dim=-1)
        asked = self.task.tables.turn_height[self.task.tables.step_index(state["subtask"])]
        return torch.maximum(scene.target_connector[:, 2] + length + APPROACH + 0.01, asked)

    def _straight_way(self, state: EpisodeState, height: Tensor, beside: Tensor, turn: Tensor) -> StraightWay:
        """Where to go on a way whose last stretch is straight: to its mouth, in where nothing is beside it, or out."""
        k = self.task.tables.step_index(state["subtask"])
        insertion, play = self.task.tables.insertion[k], self.task.tables.clearance[k]
        off, tilt, outside = beside.norm(dim=-1), turn.norm(dim=-1), -height - insertion
        inside = outside < -INSIDE
        fits = torch.where(
            inside, (off < play + 0.006) & (tilt < 0.2), (off < 0.8 * play.clamp_max(0.03)) & (tilt < 0.1)
        )
        mouth = insertion + torch.where(off < 2 * ASIDE, MOUTH, APPROACH)
        ahead = torch.where(inside, 2.0, 1.0) * INSERTION_STEP * play
        along = torch.where(fits, torch.maximum(height, -ahead), height + mouth)
        return StraightWay(insertion > 0, along, ~fits & (along > APPROACH / 2))

    def _wrist_turn(self, hand: Tensor, turn: Tensor) -> Tensor:
        """The turn (N, 3), the other way round where the wrist's last joint cannot go the short way."""
        angle = turn.norm(dim=-1, keepdim=True)
        wrist = self.physics.qpos[:, sawyer.NUM_JOINTS - 1 : sawyer.NUM_JOINTS]
        goal = wrist + (turn * hand[:, :, 2]).sum(-1, keepdim=True)
        blocked = (angle > HALF_TURN) & (goal.abs() > WRIST_RANGE)
        return torch.where(blocked, turn * (1 - 2 * torch.pi / angle.clamp_min(1e-9)), turn)

    def _connector_frames(self, state: EpisodeState, approach: Tensor) -> tuple[Tensor, Tensor]:
        """World frames (N, 3, 3) of the moving connector and of its goal, at the turn that the recipe names.

        A round part may slip about its axis, and need not be turned back: its frame is then the one that it would have
        had the hand, which approaches along `approach` (N, 3), not slipped. Where the hand approaches along that axis,
        its direction does not tell how far the part slipped: the frame is then the part's own.
        """
        tables = self.task.tables
        k = tables.step_index(state["subtask"])
        poses, rows = self.task.part_poses, torch.arange(self.physics.num_sims, device=self.physics.device)
        moving = geometry.quat_to_matrix(poses[rows, tables.moving[k], 3:]) @ tables.moving_frame[k]
        goal = geometry.quat_to_matrix(poses[rows, tables.target[k], 3:]) @ tables.goal_frame[k]
        held = (moving.transpose(1, 2) @ approach.unsqueeze(-1)).squeeze(-1)
        nominal = self._hand_in_connector[k]
        shows = tables.turns_freely[k] & (nominal[:, :2].norm(dim=-1) > 0.5)
        slipped = torch.where(shows, _heading(held) - _heading(nominal), 0.0)
        return moving @ geometry.quat_to_matrix(geometry.yaw_quat(slipped)), goal

    def _twist(self, offset: Tensor, turn: Tensor, still: Tensor) -> Tensor:
        linear = controller.clip_norm(RATE * offset, MAX_SPEED)
        angular = controller.clip_norm(RATE * turn, MAX_TURN)
        return torch.cat([linear, angular], dim=-1) * (~still).unsqueeze(-1)


class StraightWay(NamedTuple):
    """What to do on a way whose last stretch is straight; every field (N,)."""

    is_one: Tensor  # bool: the step's way is such a one
    along: Tensor  # how far to move out along the way, m; negative: in
    first: Tensor  # bool: along the way alone, the part is too deep to go sideways

    def goal(self, beside: Tensor, way_out: Tensor) -> Tensor:
        """The offset (N, 3) to move the part by, m."""
        return torch.where(self.first.unsqueeze(-1), 0.0, beside) + self.along.unsqueeze(-1) * way_out


def _hand_in_connector(tables: RecipeTables) -> Tensor:
    """The hand's approach direction in the moving connector's frame as each step begins, (K, 3)."""
    steps = torch.arange(tables.num_steps, device=tables.moving.device)
    part = geometry.quat_to_matrix(tables.nominal_poses()[steps, tables.moving, 3:])
    return ((part @ tables.moving_frame).transpose(1, 2) @ tables.grip_direction.unsqueeze(-1)).squeeze(-1)


def _heading(direction: Tensor) -> Tensor:
    """Angle of directions (N, 3) about z, rad, (N,)."""
    return torch.atan2(direction[:, 1], direction[:, 0])


def _split(offset: Tensor, direction: Tensor) -> tuple[Tensor, Tensor]:
    """Offsets (N, 3) along unit vectors `direction` (N, 3), (N,), and beside them, (N, 3)."""
    along = (offset * direction).sum(-1)
    return along, offset - along.unsqueeze(-1) * direction


def _slack(height: Tensor, above: float) -> Tensor:
    """Tolerance (N,), 1 from `above` (m) upwards to `SLACK` at the goal: one jolt does not undo a lowering."""
    return 1 + (SLACK - 1) * (1 - height / above).clamp(0, 1)
