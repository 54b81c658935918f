"""Snapshots at other positions: what a density fitted to states needs to draw states that can be."""

from __future__ import annotations

import mujoco
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from tstar_envs import connection, geometry
from tstar_envs.physics.state_row import row_slice
from tstar_envs.robots import sawyer
from tstar_envs.tasks.recipe_tables import RecipeTables

MAX_PENETRATION = 0.004
"""Deeper contact, m, is impossible: resting contact in this physics stays under 1 mm."""
_ROBOT_QPOS = sawyer.NUM_JOINTS + 2
_QPOS, _QVEL = mujoco.mjtState.mjSTATE_QPOS, mujoco.mjtState.mjSTATE_QVEL
_WARMSTART = mujoco.mjtState.mjSTATE_WARMSTART


class StateEditor:
    """Reads and replaces the positions in snapshots of one model."""

    def __init__(self, model: mujoco.MjModel, tables: RecipeTables):
        self.model, self.tables = model, tables
        self._data = mujoco.MjData(model)

    def qpos_of(self, snapshot: TensorDictBase) -> Tensor:
        """Joint positions (n, nq) of snapshots [n], quaternions with the signs that observations show."""
        return snapshot["physics"][:, self._slice(_QPOS)].clone()

    def with_qpos(self, snapshot: TensorDictBase, qpos: Tensor) -> tuple[TensorDict, Tensor]:
        """Snapshots [n] at positions (n, nq), at rest, welds at the parts' new relative poses.

        Quaternions are normalised, and take the sign nearer to the snapshot's own: observations show the sign.

        Returns:
            The snapshots, and which are possible, (n,) bool: finite, nothing penetrates by more than
            `MAX_PENETRATION`, joints within limits, and every active weld joins connectors that are aligned.
        """
        snapshot, qpos = snapshot.clone(), qpos.to(torch.float64).clone()
        poses = qpos[:, _ROBOT_QPOS:].unflatten(-1, (self.tables.num_parts, 7))
        own = self.qpos_of(snapshot)[:, _ROBOT_QPOS:].unflatten(-1, (self.tables.num_parts, 7))[..., 3:]
        sign = torch.where((own * poses[..., 3:]).sum(-1, keepdim=True) < 0, -1.0, 1.0)
        poses[..., 3:] = sign * torch.nn.functional.normalize(poses[..., 3:], dim=-1)
        rows = snapshot["physics"]
        rows[:, self._slice(_QPOS)] = qpos
        rows[:, self._slice(_QVEL)] = 0.0
        rows[:, self._slice(_WARMSTART)] = 0.0
        active = rows[:, self._slice(mujoco.mjtState.mjSTATE_EQ_ACTIVE)] > 0
        possible = qpos.isfinite().all(-1)
        for k in range(self.tables.num_steps):
            target, moving = poses[:, self.tables.target[k]], poses[:, self.tables.moving[k]]
            pose = torch.cat(
                geometry.relative_pose(target[:, :3], target[:, 3:], moving[:, :3], moving[:, 3:]), dim=-1
            )
            snapshot["welds"][:, k, 3:10] = torch.where(
                active[:, k : k + 1], pose, snapshot["welds"][:, k, 3:10]
            )
            possible &= ~active[:, k] | self._aligned(k, target, moving)
        for i in possible.nonzero().flatten().tolist():
            possible[i] = self._fits(qpos[i], active[i])
        return snapshot, possible

    def _aligned(self, k: int, target: Tensor, moving: Tensor) -> Tensor:
        ends = []
        for pose, connector in (
            (moving, self.tables.moving_connector[k]),
            (target, self.tables.target_connector[k]),
        ):
            point, quat = geometry.compose_pose(pose[:, :3], pose[:, 3:], connector[:3], connector[3:])
            ends += [point, geometry.quat_to_matrix(quat)]
        return connection.align(*ends, self.tables.allowed_angles[k].expand(len(moving), -1)).aligned

    def _fits(self, qpos: Tensor, active: Tensor) -> bool:
        self._data.qpos[:] = qpos.cpu().numpy()
        self._data.eq_active[:] = active.cpu().numpy()
        mujoco.mj_fwdPosition(self.model, self._data)
        limited = self.model.jnt_limited.astype(bool)
        at = self._data.qpos[self.model.jnt_qposadr[limited]]
        low, high = self.model.jnt_range[limited].T
        deepest = self._data.contact.dist.min() if self._data.ncon else 0.0
        slack = 1e-3
        return bool(deepest > -MAX_PENETRATION and (at > low - slack).all() and (at < high + slack).all())

    def _slice(self, component: mujoco.mjtState) -> slice:
        return row_slice(self.model, component)
