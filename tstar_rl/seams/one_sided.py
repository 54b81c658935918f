"""Quaternions on one side: q and -q are one turn, and a spread or a split of the numbers must not see two."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["one_sided"]


def one_sided(poses: NDArray[np.floating]) -> NDArray[np.floating]:
    """Poses (n, 7 P), a position and a quaternion of each part, with all quaternions of a part on one side.

    That is the side of the main axis of the part's quaternions, so that no heap is split; of the axis' two directions,
    the one that the part's first quaternion is on. It is `tstar_envs.geometry.one_sided` without torch, which the
    reading of results does not load.
    """
    parts = poses.reshape(len(poses), poses.shape[1] // 7, 7).copy()
    for part in range(parts.shape[1] if len(poses) else 0):
        quaternions = parts[:, part, 3:].astype(np.float64)
        along = quaternions @ np.linalg.eigh(quaternions.T @ quaternions).eigenvectors[:, -1]
        other = (along < 0) != (along[0] < 0)
        parts[other, part, 3:] *= -1
    return parts.reshape(poses.shape)
