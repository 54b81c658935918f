"""Whether the arm can bring its hand to a pose: inverse kinematics from a few starts, within the joints' ranges."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

from tstar_envs.robots import sawyer

ITERATIONS, DAMPING, STEP = 120, 0.05, 0.3
_TIP = "griptip_site"


class Shortfall(NamedTuple):
    """How far the hand stays from a pose: m, and rad."""

    distance: float
    angle: float

    @property
    def reached(self) -> bool:
        return self.distance < 0.01 and self.angle < 0.1


def shortfall(model: mujoco.MjModel, tip: np.ndarray, frame: np.ndarray) -> Shortfall:
    """The least shortfall over a few starts from the pose `tip` (3,), m, `frame` (3, 3), columns x, y, z, world."""
    data, best = mujoco.MjData(model), Shortfall(np.inf, np.inf)
    for wrist in (0.0, np.pi, -np.pi):
        for shoulder in (0.0, 0.7, -0.7):
            start = np.array(sawyer.HOME_QPOS)
            start[0] += shoulder
            start[-1] += wrist
            best = min(best, _solve(model, data, start, tip, frame), key=lambda s: s.distance + 0.1 * s.angle)
            if best.reached:
                return best
    return best


def _solve(model, data, start: np.ndarray, tip: np.ndarray, frame: np.ndarray) -> Shortfall:
    n, site = sawyer.NUM_JOINTS, model.site(_TIP).id
    low, high = model.jnt_range[:n].T
    data.qpos[:n] = np.clip(start, low, high)
    jacobian, found = np.zeros((6, model.nv)), Shortfall(np.inf, np.inf)
    for _ in range(ITERATIONS):
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        off = tip - data.site_xpos[site]
        turn = _rotation_vector(data.site_xmat[site].reshape(3, 3), frame)
        found = Shortfall(float(np.linalg.norm(off)), float(np.linalg.norm(turn)))
        if found.reached:
            break
        mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], site)
        arm, error = jacobian[:, :n], np.concatenate([off, turn])
        change = arm.T @ np.linalg.solve(arm @ arm.T + DAMPING**2 * np.eye(6), error)
        data.qpos[:n] = np.clip(data.qpos[:n] + np.clip(change, -STEP, STEP), low, high)
    return found


def _rotation_vector(current: np.ndarray, goal: np.ndarray) -> np.ndarray:
    quat, vector = np.zeros(4), np.zeros(3)
    mujoco.mju_mat2Quat(quat, (goal @ current.T).ravel())
    mujoco.mju_quat2Vel(vector, quat, 1.0)
    return vector
