"""Furniture assembly as a batched task: observation, subtasks, connections, reward, termination.

Source: docs/task.md.
"""

from __future__ import annotations

import torch
from torch import Tensor

from tstar_envs import geometry
from tstar_envs.connection import WrongPairs
from tstar_envs.furniture.schema import Furniture
from tstar_envs.physics.masks import write
from tstar_envs.physics.view import PhysicsView
from tstar_envs.robots import sawyer
from tstar_envs.settings import TaskSettings
from tstar_envs.tasks.actions import CONNECT, GRIPPER
from tstar_envs.tasks.episode_start import EpisodeStarts
from tstar_envs.tasks.phase_reward import PHASES
from tstar_envs.tasks.recipe_tables import RecipeTables
from tstar_envs.tasks.retreat import draw_back, joint_speeds
from tstar_envs.tasks.scene_reader import Scene, SceneReader
from tstar_envs.tasks.step_reward import StepReward, moved
from tstar_envs.tasks.task import BatchedTask, EpisodeState

DISTURBED = 0.1


class Assembly(BatchedTask):
    """The task over the simulations of `physics`; `subtask` is one step of the recipe, or None for all in a row."""

    def __init__(
        self, furniture: Furniture, physics: PhysicsView, subtask: int | None, settings: TaskSettings,
        generator: torch.Generator,
    ):  # fmt: skip
        self.furniture, self.physics, self.subtask, self.settings = furniture, physics, subtask, settings
        self.tables = RecipeTables(furniture, physics.device)
        self.starts = EpisodeStarts(self.tables, physics, settings, generator)
        self.step_reward = StepReward(self.tables, physics.device, settings)
        self.last_subtask = self.tables.num_steps - 1 if subtask is None else subtask
        self.step_limit = settings.max_steps * (self.tables.num_steps if subtask is None else 1)
        self._wrong = WrongPairs(furniture, physics.device)
        self._reader = SceneReader(self.tables, physics, furniture.part_names)
        self._speeds = joint_speeds(settings.velocity_scale, physics.device)
        self._open = torch.tensor(sawyer.FINGER_OPEN, dtype=torch.float64, device=physics.device)
        self._stroke = (
            torch.tensor(sawyer.FINGER_CLOSED, dtype=torch.float64, device=physics.device) - self._open
        )
        joints = sawyer.NUM_JOINTS
        self._arm, self._fingers = physics.ctrl[:, :joints], physics.ctrl[:, joints:]
        self._observed = [  # live views, in the order of the observation; the phase follows
            physics.qpos[:, :joints], physics.qvel[:, :joints], physics.qpos[:, joints:sawyer.NUM_QPOS],
            physics.sensors(("grip_pos", "hand_quat", "grip_linvel", "grip_angvel")), physics.qpos[:, sawyer.NUM_QPOS:],
        ]  # fmt: skip
        self._phases = torch.eye(len(PHASES), dtype=torch.float64, device=physics.device)

    @property
    def part_poses(self) -> Tensor:
        """(N, parts, 7), world: a live view of the state, parts in the order of the observation."""
        return self.physics.qpos[:, sawyer.NUM_QPOS :].unflatten(-1, (self.tables.num_parts, 7))

    def new_state(self) -> EpisodeState:
        """Episode state of N simulations that have not begun."""
        n, device = self.physics.num_sims, self.physics.device
        whole = {name: torch.zeros(n, dtype=torch.long, device=device) for name in _WHOLE}
        real = {name: torch.zeros(n, dtype=torch.float64, device=device) for name in _REAL}
        flags = {name: torch.zeros(n, dtype=torch.bool, device=device) for name in _FLAGS}
        points = {name: torch.zeros(n, 3, dtype=torch.float64, device=device) for name in _POINTS}
        potential = torch.zeros(n, len(PHASES), dtype=torch.float64, device=device)
        return {**whole, **real, **flags, **points, "potential": potential}

    def initialize_episode(self, state: EpisodeState, mask: Tensor) -> None:
        first = self.subtask or 0
        self.starts.place(mask, first)
        fresh = self.new_state()
        fresh["subtask"].fill_(first)
        assign(state, fresh, mask)
        self.begin_subtask(state, mask)

    def begin_episode(self, state: EpisodeState, mask: Tensor) -> None:
        """Starts the episode clocks of simulations that were put into a restored state."""
        fresh = self.new_state()
        assign(state, {name: fresh[name] for name in _OF_EPISODES}, mask)

    def begin_subtask(self, state: EpisodeState, mask: Tensor) -> None:
        """Sets what the reward remembers for the subtask that `state` names, in the simulations of `mask`."""
        scene = self.scene(state)
        fresh = self.new_state()
        fresh["subtask"] = state["subtask"]
        fresh["phase"].fill_(1 if self.settings.reset_robot else 0)
        fresh["grip_action"].fill_(-1.0)
        fresh["start_tip"].copy_(scene.tip)
        fresh["start_target"].copy_(scene.target_connector)
        fresh["lift_point"].copy_(scene.part + self.tables.waypoint[self.tables.step_index(state["subtask"])])
        fresh["potential"].copy_(self.step_reward.potentials(self.scene(fresh)))
        kept = ("subtask", *_OF_EPISODES)
        assign(state, {name: value for name, value in fresh.items() if name not in kept}, mask)

    def before_step(self, state: EpisodeState, action: Tensor) -> None:
        grip = action[:, GRIPPER : GRIPPER + 1]
        closed = (grip > 0).double() if self.settings.gripper == "sign" else (grip + 1) / 2
        self._arm.copy_(action[:, : sawyer.NUM_JOINTS] * self._speeds)
        self._fingers.copy_(self._open + closed * self._stroke)

    def after_step(self, state: EpisodeState, action: Tensor, failed: Tensor) -> None:
        scene, sound = self.scene(state), ~failed
        state["episode_step"] = state["episode_step"] + 1
        asks = (action[:, CONNECT] > 0) & sound
        connected = asks & scene.touching & scene.aligned & (state["subtask"] < self.tables.num_steps)
        state["wrong"] = self._wrong_connection(state, scene, asks & ~connected)
        state["failed"] = failed
        state["reward"] = self.step_reward.pay(state, scene, action, connected) * sound
        state["disturbed"] = moved(scene) > DISTURBED
        state["success"] = connected & (state["subtask"] == self.last_subtask)
        if bool(connected.any()):
            self._connect(state, connected)

    def get_reward(self, state: EpisodeState) -> Tensor:
        return state["reward"]

    def get_termination(self, state: EpisodeState) -> tuple[Tensor, Tensor]:
        terminated = state["success"] | state["wrong"] | state["failed"]
        if self.settings.end_on_disturbance:
            terminated = terminated | state["disturbed"]
        return terminated, (state["episode_step"] >= self.step_limit) & ~terminated

    def get_observation(self, state: EpisodeState) -> Tensor:
        return torch.cat([*self._observed, self._phases.index_select(0, state["phase"])], dim=-1)

    def scene(self, state: EpisodeState) -> Scene:
        """What the simulations look like to the subtask that each is at."""
        return self._reader.read(state)

    def connect_ideally(self, subtask: int, mask: Tensor) -> None:
        """Moves step `subtask`'s part, and what is welded to it, to its ideal pose in the simulations of `mask`."""
        target = self.part_poses[:, self.tables.target[subtask]]
        ideal = self.tables.ideal_relative_pose(subtask)
        pose = torch.cat(geometry.compose_pose(target[:, :3], target[:, 3:], ideal[:3], ideal[3:]), dim=-1)
        write(self.part_poses, self.tables.move_group(subtask, self.part_poses, pose), mask)

    def _wrong_connection(self, state: EpisodeState, scene: Scene, asks: Tensor) -> Tensor:
        held = scene.touches.all(0)
        suspects = asks & held.any(0)
        if not bool(suspects.any()):
            return suspects
        step, held = self.tables.step_index(state["subtask"]), held.t()
        if self.physics.steps_together:  # on a GPU, where no shape should depend on data
            return suspects & self._wrong.made(self.part_poses, held, step)
        rows, wrong = suspects.nonzero().squeeze(-1), torch.zeros_like(suspects)
        wrong[rows] = self._wrong.made(self.part_poses[rows], held[rows], step[rows])
        return wrong

    def _connect(self, state: EpisodeState, mask: Tensor) -> None:
        """Welds the parts where they met, sends the arm home or back, and begins the next subtask."""
        for k in range(self.tables.num_steps):
            rows = mask & (state["subtask"] == k)
            if self.settings.snap:
                self.connect_ideally(k, rows)
            self.starts.weld(k, rows)
        if self.settings.reset_robot:
            self.starts.home_robot(mask)
        elif self.settings.retreat_steps:
            mask = mask & ~self._draw_back(state, mask)
        self.physics.forward(mask)
        state["subtask"] = state["subtask"] + mask
        state["completed"] = state["completed"] + mask
        self.begin_subtask(state, mask)

    def _draw_back(self, state: EpisodeState, mask: Tensor) -> Tensor:
        """Lets go and draws the arm back; those that fail on the way, (N,), end their episode as any failure does."""
        home, steps = self.starts.home, self.settings.retreat_steps
        failed = draw_back(self.physics, home, self._speeds, steps, mask)
        if bool(failed.any()):
            self.starts.failures += int(failed.sum())
            self.physics.clear(failed)
            self.physics.forward(failed)
            state["failed"], state["success"] = state["failed"] | failed, state["success"] & ~failed
            state["reward"] = state["reward"] * ~failed
        return failed


_WHOLE = ("subtask", "phase", "episode_step", "completed")
_REAL = ("reward", "grip_action", "asked")
_FLAGS = ("half_paid", "success", "wrong", "failed", "disturbed")
_POINTS = ("start_tip", "start_target", "lift_point")
_OF_EPISODES = ("episode_step", "completed", "reward", "success", "wrong", "failed", "disturbed")


def assign(state: EpisodeState, fresh: EpisodeState, mask: Tensor) -> None:
    """Replaces entries of `state` by those of `fresh` in the simulations of `mask`; never writes in place."""
    for name, value in fresh.items():
        where = mask.reshape(-1, *[1] * (value.ndim - 1))
        state[name] = torch.where(where, value, state[name])
