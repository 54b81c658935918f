"""Snapshots at other positions: what a density fitted to states needs to draw states that can be."""

from __future__ import annotations

import mujoco
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from tstar_envs import connection, geometry
from tstar_envs.physics.state_row import row_size, row_slice
from tstar_envs.robots import sawyer
from tstar_envs.snapshot_check import APART
from tstar_envs.tasks.recipe_tables import RecipeTables

MAX_PENETRATION = 0.004
"""Deeper contact, m, is impossible: resting contact in this physics stays under 1 mm."""
MAX_BEYOND = 1e-3
"""Rad or m beyond a joint's limit, which is soft."""
ROUNDING = 1e-6
"""M, rad or cosine by which a snapshot's own positions may seem to differ from themselves."""
_QPOS, _QVEL = mujoco.mjtState.mjSTATE_QPOS, mujoco.mjtState.mjSTATE_QVEL
_WARMSTART = mujoco.mjtState.mjSTATE_WARMSTART


class StateEditor:
    """Reads and replaces the positions in snapshots of one model."""

    def __init__(self, model: mujoco.MjModel, tables: RecipeTables):
        self.model, self.tables = model, tables
        self._data = mujoco.MjData(model)

    def qpos_of(self, snapshot: TensorDictBase) -> Tensor:
        """Joint positions (n, nq) of snapshots [n], quaternions with the signs that observations show."""
        return self._physics(snapshot)[:, self._slice(_QPOS)].clone()

    def _physics(self, snapshot: TensorDictBase) -> Tensor:
        """The simulators' states in a snapshot, (n, S); ValueError for what is none."""
        if "physics" not in snapshot.keys():
            there = ", ".join(map(str, snapshot.keys())) or "nothing"
            raise ValueError(
                f"a snapshot has physics, welds and task, as snapshot() gives it; this has {there}"
            )
        rows = snapshot["physics"]
        if rows.ndim != 2 or rows.shape[1] != row_size(self.model):
            raise ValueError(
                f"the physics of a snapshot of this furniture has shape (n, {row_size(self.model)}), got "
                f"{tuple(rows.shape)}: was it taken of other furniture?"
            )
        return rows

    def one_sided(self, qpos: Tensor) -> Tensor:
        """Positions (n, nq) with the quaternions of each part on one side, so that they have a mean and a spread."""
        qpos = qpos.clone()
        for part in range(self.tables.num_parts if len(qpos) else 0):
            quats = slice(sawyer.NUM_QPOS + 7 * part + 3, sawyer.NUM_QPOS + 7 * (part + 1))
            qpos[:, quats] = geometry.one_sided(qpos[:, quats])
        return qpos

    def with_qpos(self, snapshot: TensorDictBase, qpos: Tensor) -> tuple[TensorDict, Tensor]:
        """Snapshots [n] at positions (n, nq), at rest, welds at the parts' new relative poses.

        Quaternions are normalised, and take the sign nearer to the snapshot's own: observations show the sign.

        Returns:
            The snapshots, and which are possible, (n,) bool: finite, nothing penetrates by more than
            `MAX_PENETRATION`, joints within limits, and every active weld joins connectors that are aligned. A
            snapshot that breaks one of these itself, as a finger does that presses on a part, may be replaced by what
            breaks it no more, but not by welds of connectors that are `APART`: a snapshot with one is refused.

        Raises:
            ValueError: the positions are of another number of snapshots or of another scene, or there is no snapshot.
        """
        if tuple(qpos.shape) != (wanted := (len(snapshot), self.model.nq)):
            raise ValueError(
                f"joint positions of {len(snapshot)} snapshots have shape {wanted}, got {tuple(qpos.shape)}"
            )
        snapshot, qpos = snapshot.clone(), qpos.to(torch.float64).clone()
        poses = qpos[:, sawyer.NUM_QPOS :].unflatten(-1, (self.tables.num_parts, 7))
        before = self.qpos_of(snapshot).to(torch.float64)
        had = before[:, sawyer.NUM_QPOS :].unflatten(-1, (self.tables.num_parts, 7))
        sign = torch.where((had[..., 3:] * poses[..., 3:]).sum(-1, keepdim=True) < 0, -1.0, 1.0)
        poses[..., 3:] = sign * torch.nn.functional.normalize(poses[..., 3:], dim=-1)
        rows = snapshot["physics"]
        rows[:, self._slice(_QPOS)] = qpos
        rows[:, self._slice(_QVEL)] = 0.0
        rows[:, self._slice(_WARMSTART)] = 0.0
        active = rows[:, self._slice(mujoco.mjtState.mjSTATE_EQ_ACTIVE)] > 0
        possible = qpos.isfinite().all(-1) & (poses[..., 3:].norm(dim=-1) > 0.5).all(
            -1
        )  # a quaternion of 0 stays 0
        for k in range(self.tables.num_steps):
            target, moving = poses[:, self.tables.target[k]], poses[:, self.tables.moving[k]]
            pose = torch.cat(
                geometry.relative_pose(target[:, :3], target[:, 3:], moving[:, :3], moving[:, 3:]), dim=-1
            )
            snapshot["welds"][:, k, 3:10] = torch.where(
                active[:, k : k + 1], pose, snapshot["welds"][:, k, 3:10]
            )
            found = self._alignment(k, target, moving)
            own = self._alignment(k, had[:, self.tables.target[k]], had[:, self.tables.moving[k]])
            may_stay = _no_worse(found, own) & (found.distance < APART)
            possible &= ~active[:, k] | found.aligned | may_stay
        for i in possible.nonzero().flatten().tolist():
            depth, beyond = self._strain(qpos[i], active[i])
            if depth > MAX_PENETRATION or beyond > MAX_BEYOND:
                own = self._strain(before[i], active[i])
                possible[i] = depth <= max(own[0] + ROUNDING, MAX_PENETRATION)
                possible[i] &= beyond <= max(own[1] + ROUNDING, MAX_BEYOND)
        return snapshot, possible

    def _alignment(self, k: int, target: Tensor, moving: Tensor) -> connection.Alignment:
        """How the connectors of step `k` lie to each other, its parts at poses `target` and `moving` (n, 7)."""
        ends = []
        for pose, connector in (
            (moving, self.tables.moving_connector[k]),
            (target, self.tables.target_connector[k]),
        ):
            point, quat = geometry.compose_pose(pose[:, :3], pose[:, 3:], connector[:3], connector[3:])
            ends += [point, geometry.quat_to_matrix(quat)]
        return connection.align(*ends, self.tables.allowed_angles[k].expand(len(moving), -1))

    def _strain(self, qpos: Tensor, active: Tensor) -> tuple[float, float]:
        """How deep something penetrates, m, and how far a joint is beyond its limit, rad or m; below 0: not at all.

        Of a capsule whose axis is in a box MuJoCo makes no contact in some poses: that is not seen.
        """
        self._data.qpos[:] = qpos.cpu().numpy()
        self._data.eq_active[:] = active.cpu().numpy()
        mujoco.mj_fwdPosition(self.model, self._data)
        limited = self.model.jnt_limited.astype(bool)
        at = self._data.qpos[self.model.jnt_qposadr[limited]]
        low, high = self.model.jnt_range[limited].T
        depth = -self._data.contact.dist.min() if self._data.ncon else 0.0
        return float(depth), float(max((low - at).max(), (at - high).max()))

    def _slice(self, component: mujoco.mjtState) -> slice:
        return row_slice(self.model, component)


def _no_worse(found: connection.Alignment, own: connection.Alignment) -> Tensor:
    """(n,) bool: whether connectors are no further apart, and no more tilted or turned, than they were."""
    return (
        (found.distance <= own.distance + ROUNDING)
        & (found.up_cosine >= own.up_cosine - ROUNDING)
        & (found.forward_cosine >= own.forward_cosine - ROUNDING)
    )
