"""Where episodes begin: parts laid out with noise, earlier steps preassembled, the arm at home."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from tstar_envs import geometry
from tstar_envs.physics.masks import write
from tstar_envs.physics.view import PhysicsView
from tstar_envs.robots import sawyer
from tstar_envs.settings import TaskSettings
from tstar_envs.tasks.recipe_tables import RecipeTables

MIN_CLEARANCE = 0.0005
"""A jittered preassembled part is held at least this far off its target, m: welded parts should not press."""
TRIES = 10
"""Starts drawn for one simulation before it is an error that none of them settles."""


class StartError(RuntimeError):
    """No episode can begin: the simulations fail while their parts settle."""


class EpisodeStarts:
    """Writes start states into a batch of simulations, drawing noise from a private generator.

    During an episode, a connection calls two of its methods, too: `weld`, and `home_robot` where the arm is put back.
    """

    def __init__(
        self, tables: RecipeTables, physics: PhysicsView, settings: TaskSettings, generator: torch.Generator
    ):
        self.tables, self.physics, self.settings, self.generator = tables, physics, settings, generator
        home = torch.tensor(
            [*sawyer.HOME_QPOS, *sawyer.FINGER_OPEN], dtype=torch.float64, device=physics.device
        )
        self.home = home
        """(9,): joints, rad, and open fingers, m."""
        self._made: MadeStarts | None = None
        self.failures = 0
        """Simulations that failed beside the steps: while their parts settled, or while the arm drew back."""
        self._jittered = settings.preassembled == "jitter"
        self._ideal = [tables.ideal_relative_pose(k) for k in range(tables.num_steps)]

    def place(self, mask: Tensor, subtask: int) -> None:
        """Starts the simulations of `mask` at `subtask`, with the steps before it preassembled.

        Where a simulator can only step all its simulations together, starts are made N at a time and handed out: a
        few simulations that end would otherwise make all of them wait while their parts settle.
        """
        if not self.physics.steps_together:
            return self._make(mask, subtask)
        wanted = int(mask.sum())
        if self._made is None or self._made.subtask != subtask or self._made.left < wanted:
            self._made = self._make_all(subtask)
        self.physics.set_state(*self._made.take(mask, wanted), mask)

    def forget(self) -> None:
        """Drops starts made in advance, so that the next ones are drawn from the generator as it is now."""
        self._made = None

    def _make_all(self, subtask: int) -> MadeStarts:
        """Makes N starts, and leaves the simulations as they are."""
        now = self.physics.state(), self.physics.eq_data.clone()
        every = torch.ones(self.physics.num_sims, dtype=torch.bool, device=self.physics.device)
        try:
            self._make(every, subtask)
            return MadeStarts(subtask, self.physics.state(), self.physics.eq_data.clone())
        finally:
            self.physics.set_state(*now)

    def _make(self, mask: Tensor, subtask: int) -> None:
        """Starts the simulations of `mask`; one that fails while its parts settle is drawn again.

        Raises:
            StartError: if one fails every time.
        """
        for _ in range(TRIES):
            mask = self._lay_out(mask, subtask)
            failed = int(mask.sum())
            if not failed:
                return
            self.failures += failed
        raise StartError(
            f"{self.tables.name}, subtask {subtask}: {failed} simulations failed while their parts settled, {TRIES} "
            "times each: the settings of the start (part_noise, jitter, drop_height) or the furniture's initial poses "
            "ask for what cannot be"
        )

    def _lay_out(self, mask: Tensor, subtask: int) -> Tensor:
        """Places the parts in the simulations of `mask` and lets them settle; (N,) bool, which of these failed.

        Every call draws noise for all N simulations, so which of them `mask` names changes nothing for the others. How
        often it is called does: a start that is drawn again moves the generator for all.
        """
        poses = self._part_poses(subtask)
        poses[..., 2] += self.settings.drop_height
        arm = self.settings.arm_noise * self._uniform(sawyer.NUM_JOINTS)
        self.physics.clear(mask)
        write(self.physics.qpos[:, sawyer.NUM_QPOS :], poses.flatten(1), mask)
        for k in range(subtask):
            self.weld(k, mask)
        self.home_robot(mask)
        failed = self.physics.settle(mask, self.settings.settle_steps) & mask
        self.home_robot(mask)
        joints = self.physics.qpos[:, : sawyer.NUM_JOINTS]
        write(joints, joints + arm, mask)
        self.physics.forward(mask)
        return failed

    def home_robot(self, mask: Tensor) -> None:
        """Puts the arm at its home pose, at rest, gripper open."""
        rest = torch.zeros_like(self.home)
        write(self.physics.qpos[:, : sawyer.NUM_QPOS], self.home, mask)
        write(self.physics.qvel[:, : sawyer.NUM_QPOS], rest, mask)
        write(self.physics.ctrl[:, : sawyer.NUM_JOINTS], rest[: sawyer.NUM_JOINTS], mask)
        write(self.physics.ctrl[:, sawyer.NUM_JOINTS :], self.home[sawyer.NUM_JOINTS :], mask)

    def weld(self, step: int, mask: Tensor) -> None:
        """Activates the weld of `step` at the pose where its two parts are now."""
        poses = self.physics.qpos[:, sawyer.NUM_QPOS :].unflatten(-1, (self.tables.num_parts, 7))
        target, moving = poses[:, self.tables.target[step]], poses[:, self.tables.moving[step]]
        pos, quat = geometry.relative_pose(target[:, :3], target[:, 3:], moving[:, :3], moving[:, 3:])
        write(self.physics.eq_data[:, step, 3:10], torch.cat([pos, quat], dim=-1), mask)
        write(self.physics.eq_active[:, step], torch.ones_like(pos[:, 0]), mask)

    def _part_poses(self, subtask: int) -> Tensor:
        """Noisy part poses with the steps before `subtask` assembled, (N, parts, 7)."""
        n, settings = self.physics.num_sims, self.settings
        poses = self.tables.initial_pose.expand(n, -1, -1).clone()
        noise = self._uniform(self.tables.num_parts, 3)
        poses[..., :2] += settings.part_noise * noise[..., :2]
        yaw = geometry.yaw_quat(math.radians(settings.part_noise_degrees) * noise[..., 2])
        poses[..., 3:] = geometry.quat_mul(yaw, poses[..., 3:])
        for k in range(subtask):
            pos, quat = self._relative_pose(k)
            target = poses[:, self.tables.target[k]]
            pose = geometry.compose_pose(target[:, :3], target[:, 3:], pos, quat)
            poses = self.tables.move_group(k, poses, torch.cat(pose, dim=-1))
        return poses

    def _relative_pose(self, step: int) -> tuple[Tensor, Tensor]:
        """Pose of step's moving part in its target's frame, (N, 3) and (N, 4): ideal, or jittered about it."""
        n, ideal = self.physics.num_sims, self._ideal[step]
        pos, quat = ideal[:3].expand(n, 3), ideal[3:].expand(n, 4)
        if not self._jittered:
            return pos, quat
        connector, goal = self.tables.moving_connector[step], self.tables.target_connector[step]
        shift, axis = self._uniform(3), torch.nn.functional.normalize(self._uniform(3), dim=-1)
        aside, tilt = self._play(step)
        turn = geometry.axis_angle_quat(axis, tilt * self._uniform(1).squeeze(-1))
        quat = geometry.quat_mul(turn, quat)
        # The part comes from the side its body lies on: shift it back along the connectors' up axis only.
        away = MIN_CLEARANCE + self.settings.jitter * shift[:, 2:].abs()
        offset = torch.cat([aside * shift[:, :2], self.tables.side[step] * away], dim=-1)
        point = goal[:3] + geometry.quat_rotate(goal[3:].expand(n, 4), offset)
        return point - geometry.quat_rotate(quat, connector[:3].expand(n, 3)), quat

    def _play(self, step: int) -> tuple[float, float]:
        """How far aside, m, and how tilted, rad, a jittered part may sit: in a socket, half of the play there."""
        aside, tilt = self.settings.jitter, math.radians(self.settings.jitter_degrees)
        depth, play = float(self.tables.insertion[step]), float(self.tables.clearance[step]) / 2
        return (min(aside, play), min(tilt, play / depth)) if depth > 0 else (aside, tilt)

    def _uniform(self, *shape: int) -> Tensor:
        """(N, *shape) in [-1, 1)."""
        draw = torch.rand(self.physics.num_sims, *shape, generator=self.generator, dtype=torch.float64)
        return (2 * draw - 1).to(self.physics.device)


class MadeStarts:
    """Start states made in advance: rows (N, S) and weld poses (N, welds, W), taken in order."""

    def __init__(self, subtask: int, rows: Tensor, welds: Tensor):
        self.subtask, self._rows, self._welds, self._taken = subtask, rows, welds, 0

    @property
    def left(self) -> int:
        return len(self._rows) - self._taken

    def take(self, mask: Tensor, wanted: int) -> tuple[Tensor, Tensor]:
        """The next `wanted` starts at the places of `mask`, rows and weld poses, (N, ...); the rest means nothing."""
        places = (self._taken + mask.cumsum(0) - 1).clamp(0, len(self._rows) - 1)
        self._taken += wanted
        return self._rows[places], self._welds[places]
