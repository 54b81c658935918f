"""One recorded episode: joint positions, and what is shown beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np

from tstar_envs.player.geometry import moving_bodies, packed

ROWS = ("subtask", "phase", "reward")
"""What the page shows of every episode; `timeline.js` has the same names."""


@dataclass
class Episode:
    """An episode of T steps, T + 1 states.

    Args:
        title: shown above it.
        positions: (T + 1, nq), joint positions, from the state before the first step on.
        subtask: (T + 1,) int, the subtask that each state is at, 0-based; the number of subtasks when all is done.
        phase: (T + 1,) int, the phase of its subtask.
        reward: (T,), what each step paid.
        success: whether the task was done.
        series: further numbers by name, (T,) each, one a step; NaN where there is none. Shown as points.

    Raises:
        ValueError: the lengths do not belong together, a position or reward is not finite, a subtask or phase is no
            whole number from 0, or a series is called as a row that every episode has.
    """

    title: str
    positions: np.ndarray
    subtask: np.ndarray
    phase: np.ndarray
    reward: np.ndarray
    success: bool
    series: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.positions = np.asarray(self.positions, dtype=np.float64)
        if self.positions.ndim != 2 or len(self.positions) < 2:
            raise ValueError(
                f"episode {self.title!r}: positions have shape (T + 1, nq) with T >= 1, got {self.positions.shape}"
            )
        steps = len(self.positions) - 1
        for name, length in (("subtask", steps + 1), ("phase", steps + 1), ("reward", steps)):
            setattr(self, name, self._checked(name, getattr(self, name), length))
        for name in ("subtask", "phase"):
            values = np.asarray(getattr(self, name), dtype=np.float64)
            if not (np.isfinite(values) & (values >= 0) & (values == np.floor(values))).all():
                raise ValueError(f"episode {self.title!r}: {name} must be whole numbers from 0")
        if taken := sorted(set(self.series) & set(ROWS)):
            raise ValueError(
                f"episode {self.title!r}: a series may not be called {', '.join(taken)}, a row that is there"
            )
        self.series = {name: self._checked(name, values, steps) for name, values in self.series.items()}
        for name in ("positions", "reward"):
            if not np.isfinite(getattr(self, name)).all():
                raise ValueError(f"episode {self.title!r}: {name} must be finite")

    def to_plain(self, model: mujoco.MjModel) -> dict[str, Any]:
        """The episode as the page reads it: poses of the bodies that move as base64, everything else as numbers.

        Raises:
            ValueError: the positions are not of `model`.
        """
        return {
            "title": self.title,
            "steps": len(self.reward),
            "success": bool(self.success),
            "poses": packed(body_poses(model, self.positions)),
            "subtask": self.subtask.astype(int).tolist(),
            "phase": self.phase.astype(int).tolist(),
            "reward": [float(f"{value:.6g}") for value in self.reward],
            "series": {name: [_number(v) for v in values] for name, values in self.series.items()},
        }

    def least_subtasks(self) -> int:
        """How many subtasks its task has, at least: those that were begun; a success ends at their number."""
        begun, last = int(self.subtask[:-1].max()) + 1, int(self.subtask[-1])
        return max(begun, last if self.success else last + 1)

    def _checked(self, name: str, values: Sequence[float] | np.ndarray, length: int) -> np.ndarray:
        array = np.asarray(values)
        if array.shape != (length,):
            raise ValueError(
                f"episode {self.title!r}: {name} has shape ({length},) beside {len(self.positions)} positions, "
                f"got {array.shape}"
            )
        return array


def body_poses(model: mujoco.MjModel, positions: np.ndarray) -> np.ndarray:
    """Poses (T + 1, bodies, 7) of the bodies that can move, position (m) and quaternion, world, by kinematics alone.

    Raises:
        ValueError: the positions (T + 1, nq) are of another model.
    """
    if positions.shape[1] != model.nq:
        raise ValueError(
            f"joint positions of one state have shape ({model.nq},), got ({positions.shape[1]},)"
        )
    data, bodies = mujoco.MjData(model), moving_bodies(model)
    poses = np.empty((len(positions), len(bodies), 7))
    for row, qpos in zip(poses, positions, strict=True):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        row[:, :3], row[:, 3:] = data.xpos[bodies], data.xquat[bodies]
    return poses


def _number(value: float) -> float | None:
    return float(f"{value:.4g}") if np.isfinite(value) else None
