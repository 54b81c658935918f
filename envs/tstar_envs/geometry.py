"""Quaternions and poses in pure torch, batched over any leading axes, in the dtype of the inputs.

Quaternions are (w, x, y, z) of unit length; `q` rotates vectors of its own frame into the parent's. A pose is a
position and a quaternion. Angles are in rad. Nothing here normalises: what goes in with unit length comes out so.
"""

from __future__ import annotations

import torch
from torch import Tensor


def quat_mul(a: Tensor, b: Tensor) -> Tensor:
    """Product of quaternions (..., 4): first b, then a."""
    aw, ax, ay, az = a.unbind(-1)
    bw, bx, by, bz = b.unbind(-1)
    return torch.stack(
        (
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ),
        -1,
    )


def quat_conj(q: Tensor) -> Tensor:
    """Inverse rotation (..., 4) of a unit quaternion."""
    return torch.cat((q[..., :1], -q[..., 1:]), -1)


def quat_rotate(q: Tensor, v: Tensor) -> Tensor:
    """Rotates vectors v (..., 3) by q (..., 4): v + 2 (w t + u x t) with u the vector part and t = u x v."""
    u = q[..., 1:]
    t = torch.linalg.cross(*torch.broadcast_tensors(u, v))
    return v + 2 * (q[..., :1] * t + torch.linalg.cross(u.expand_as(t), t))


def quat_to_matrix(q: Tensor) -> Tensor:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4); their columns are the frame's axes."""
    w, x, y, z = q.unbind(-1)
    xx, yy, zz = x * x, y * y, z * z
    xy, xz, yz, wx, wy, wz = x * y, x * z, y * z, w * x, w * y, w * z
    rows = (
        1 - 2 * (yy + zz), 2 * (xy - wz), 2 * (xz + wy),
        2 * (xy + wz), 1 - 2 * (xx + zz), 2 * (yz - wx),
        2 * (xz - wy), 2 * (yz + wx), 1 - 2 * (xx + yy),
    )  # fmt: skip
    return torch.stack(rows, -1).unflatten(-1, (3, 3))


def axis_angle_quat(axis: Tensor, angle: Tensor) -> Tensor:
    """Quaternions (..., 4) of turns by `angle` (...) about unit vectors `axis` (..., 3)."""
    half = angle / 2
    vector = axis * half.sin().unsqueeze(-1)
    return torch.cat((half.cos().unsqueeze(-1).expand(*vector.shape[:-1], 1), vector), -1)


def yaw_quat(angle: Tensor) -> Tensor:
    """Quaternions (..., 4) of turns by `angle` (...) about z."""
    half = angle / 2
    zero = torch.zeros_like(half)
    return torch.stack((half.cos(), zero, zero, half.sin()), -1)


def relative_pose(p1: Tensor, q1: Tensor, p2: Tensor, q2: Tensor) -> tuple[Tensor, Tensor]:
    """The pose 2 in frame 1, both given in one frame: position (..., 3) and quaternion (..., 4)."""
    inverse = quat_conj(q1)
    return quat_rotate(inverse, p2 - p1), quat_mul(inverse, q2)


def compose_pose(p1: Tensor, q1: Tensor, p2: Tensor, q2: Tensor) -> tuple[Tensor, Tensor]:
    """The pose 2, given in frame 1, in the frame in which 1 is given: the inverse of `relative_pose`."""
    return p1 + quat_rotate(q1, p2), quat_mul(q1, q2)


def one_sided(q: Tensor) -> Tensor:
    """Quaternions (n, 4) with the signs that put them on one side, the first one's: q and -q are one rotation.

    The sides are those of their main axis, so that no heap of near ones is split. What is on one side stays as it is.
    """
    along = q @ torch.linalg.eigh(q.T @ q).eigenvectors[:, -1]
    return torch.where(((along < 0) != (along[:1] < 0)).unsqueeze(-1), -q, q)


def up_axis(q: Tensor) -> Tensor:
    """The z axis (..., 3) of frames q (..., 4)."""
    w, x, y, z = q.unbind(-1)
    return torch.stack((2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)), -1)


def frame_with_x(axis: Tensor) -> Tensor:
    """Quaternion (4,) of the least turn that takes the x axis to the unit vector `axis` (3,)."""
    x = axis.new_tensor([1.0, 0.0, 0.0])
    cosine = torch.dot(x, axis)
    if float(cosine) < -0.999999:
        return yaw_quat(axis.new_tensor(torch.pi))
    quat = torch.cat([(1 + cosine).reshape(1), torch.linalg.cross(x, axis)])
    return torch.nn.functional.normalize(quat, dim=-1)
