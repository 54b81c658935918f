"""Where a part is, seen from another part or from the world."""

from torch import Tensor

from tstar_envs.geometry import relative_pose

__all__ = ["pose_from"]


def pose_from(poses: Tensor, part: int, base: int | None) -> tuple[Tensor, Tensor]:
    """Position (n, 3) in m and quaternion (n, 4) of a part in the frame of another one; None: as they are given.

    Args:
        poses: of all parts in one frame, the world's, say: (n, P, 7), position and unit quaternion (w, x, y, z).
        part, base: by their place in `poses`.
    """
    position, turn = poses[:, part, :3], poses[:, part, 3:]
    if base is None:
        return position, turn
    return relative_pose(poses[:, base, :3], poses[:, base, 3:], position, turn)
