"""What the simulations look like to the subtask that each is at."""

from __future__ import annotations

from typing import NamedTuple

import torch
from tensordict import TensorDict
from torch import Tensor

from tstar_envs import geometry
from tstar_envs.connection import ALIGNED, Alignment
from tstar_envs.physics.view import PhysicsView
from tstar_envs.robots import sawyer
from tstar_envs.tasks.measures import FRAMES, MEASURES, POINTS, ROWS, VECTORS, Measures
from tstar_envs.tasks.recipe_tables import RecipeTables

_ALIGNMENT = MEASURES["gap"]
_ROBOT_QPOS = sawyer.NUM_JOINTS + 2


class Scene(NamedTuple):
    """What the reward and the scripted expert look at; positions in m, world frame."""

    vectors: Tensor  # (N, V, 3), named in `measures.VECTORS`
    measures: Tensor  # (N, M), named in `measures.MEASURES`
    touches: Tensor  # (N, 2, parts) bool, which finger touches which part
    touching: Tensor  # (N,) bool, both fingers on the moving part or on what is welded to it
    aligned: Tensor  # (N,) bool, `alignment.aligned`

    def vector(self, name: str) -> Tensor:
        """A point or axis by name, (N, 3)."""
        return self.vectors[:, VECTORS[name]]

    def measure(self, name: str) -> Tensor:
        """A measure by name, (N,)."""
        return self.measures[:, MEASURES[name]]

    @property
    def tip(self) -> Tensor:
        """(N, 3), between the finger tips."""
        return self.vector("hand.origin")

    @property
    def approach(self) -> Tensor:
        """(N, 3), the hand's z axis."""
        return self.vector("hand.z")

    @property
    def closing(self) -> Tensor:
        """(N, 3), the hand's y axis."""
        return self.vector("hand.y")

    @property
    def part(self) -> Tensor:
        """(N, 3), the moving part."""
        return self.vector("moving.origin")

    @property
    def grasp_point(self) -> Tensor:
        """(N, 3)."""
        return self.vector("moving.grasp_point")

    @property
    def grasp_axis(self) -> Tensor:
        """(N, 3)."""
        return self.vector("moving.grasp_axis")

    @property
    def grip_direction(self) -> Tensor:
        """(N, 3), the approach direction asked for while grasping."""
        return self.vector("grip_direction")

    @property
    def moving_connector(self) -> Tensor:
        """(N, 3)."""
        return self.vector("moving.connector")

    @property
    def target_connector(self) -> Tensor:
        """(N, 3)."""
        return self.vector("target.connector")

    @property
    def alignment(self) -> Alignment:
        """How the moving connector lies to its target."""
        names = ("gap", "up", "forward", "moving_projection", "target_projection")
        return Alignment(*(self.measure(name) for name in names))


class SceneReader:
    """Reads scenes off the simulations of `physics`, in few operations: all frames turn their points and axes at once.

    A simulation whose steps are all done is seen as at the last one.
    """

    def __init__(self, tables: RecipeTables, physics: PhysicsView, part_names: tuple[str, ...]):
        n, parts, device = physics.num_sims, tables.num_parts, physics.device
        hand = torch.full_like(tables.moving, parts)
        self._frames = _with_last(torch.stack([tables.moving, tables.target, hand], dim=-1))
        self._first = (parts + 1) * torch.arange(n, device=device).unsqueeze(-1)
        self._columns = _with_last(_columns(tables))
        self._is_point = torch.tensor(
            [[float(row in POINTS)] for row in ROWS], dtype=torch.float64, device=device
        )
        self._grip_direction = _with_last(tables.grip_direction)
        self._group = _with_last(tables.group).unsqueeze(1)
        self._measure = Measures(tables.z_finedist, _with_last(tables.allowed_angles), device)
        self._least, self._most = (
            torch.tensor(x, dtype=torch.float64, device=device) for x in zip(*ALIGNED, strict=True)
        )
        self._poses = [physics.qpos[:, _ROBOT_QPOS:], physics.sensor("tip_pos"), physics.sensor("hand_quat")]
        fingers = [f"{finger}_touches_{part}" for finger in sawyer.FINGERS for part in part_names]
        self._contacts = physics.sensors(fingers).unflatten(-1, (len(sawyer.FINGERS), parts))

    def read(self, state: TensorDict) -> Scene:
        """The scenes of `state`."""
        step = state["subtask"]
        vectors = self._vectors(state, step)
        touches = self._contacts > 0
        touching = (touches & self._group.index_select(0, step)).any(-1).all(-1)
        measures = self._measure(vectors, step)
        lies = measures[:, _ALIGNMENT : _ALIGNMENT + len(ALIGNED)]
        aligned = ((lies > self._least) & (lies < self._most)).all(-1)
        return Scene(vectors, measures, touches, touching, aligned)

    def _vectors(self, state: TensorDict, step: Tensor) -> Tensor:
        n = len(step)
        frames = (self._frames.index_select(0, step) + self._first).view(-1)
        poses = torch.cat(self._poses, dim=-1).view(-1, 7).index_select(0, frames)
        turn = geometry.quat_to_matrix(poses[:, 3:]).transpose(1, 2)
        columns = self._columns.index_select(0, step).view(-1, len(ROWS), 3)
        turned = torch.addcmul(torch.bmm(columns, turn), self._is_point, poses[:, None, :3])
        return torch.cat(
            [
                turned.view(n, -1), state["start_tip"], state["start_target"], state["lift_point"],
                self._grip_direction.index_select(0, step),
            ],
            dim=-1,
        ).view(n, -1, 3)  # fmt: skip


def _with_last(rows: Tensor) -> Tensor:
    """Tables (K, ...) with the last row once more, for simulations whose steps are all done."""
    return torch.cat([rows, rows[-1:]])


def _columns(tables: RecipeTables) -> Tensor:
    """(K, frames, rows, 3): points and axes in the frames that they turn with; see `measures.ROWS`."""
    steps, one = tables.num_steps, torch.eye(3, dtype=torch.float64, device=tables.moving.device)
    out = one.new_zeros(steps, len(FRAMES), len(ROWS), 3)
    out[:, 0, 1], out[:, 0, 2:5] = tables.moving_connector[:, :3], tables.moving_frame.transpose(1, 2)
    out[:, 0, 5], out[:, 0, 6] = tables.grasp_point, tables.grasp_axis
    out[:, 1, 1], out[:, 1, 2:5] = tables.target_connector[:, :3], tables.target_frame.transpose(1, 2)
    out[:, 2, 2:5] = one
    return out
