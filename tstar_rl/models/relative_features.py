"""What a person would look at: the hand seen from the grasp, and the connector seen from its target.

Observations are in world coordinates, where a leg must be placed to a centimetre in a workspace of a metre. The
same facts as differences, in the frames that matter and at several scales, let a small network see the last
centimetre. Everything is a smooth function of the observation, but for the choice of the nearest allowed angle.
"""

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor, nn

from tstar_rl.env.layout import FINGERS, GRIP_POSITION, HAND_QUAT, PARTS

# Row-major rotation matrix of a unit quaternion q = (w, x, y, z) as a linear map of the products q_i q_j.
_ROTATION = (
    ((("ww", 1), ("xx", 1), ("yy", -1), ("zz", -1)), (("xy", 2), ("wz", -2)), (("xz", 2), ("wy", 2))),
    ((("xy", 2), ("wz", 2)), (("ww", 1), ("xx", -1), ("yy", 1), ("zz", -1)), (("yz", 2), ("wx", -2))),
    ((("xz", 2), ("wy", -2)), (("yz", 2), ("wx", 2)), (("ww", 1), ("xx", -1), ("yy", -1), ("zz", 1))),
)


def _products_to_rotation() -> Tensor:
    """(16, 3, 3) float64: contracts q (x) q, flattened, to the rotation matrix of q."""
    table = torch.zeros(16, 3, 3, dtype=torch.float64)
    for i, row in enumerate(_ROTATION):
        for j, terms in enumerate(row):
            for (a, b), factor in terms:
                table["wxyz".index(a) * 4 + "wxyz".index(b), i, j] = factor
    return table


def _frame(pose: Tensor, table: Tensor) -> tuple[Tensor, Tensor]:
    """pose (7,) -> position (3,), rotation (3, 3)."""
    quat = pose[3:] / pose[3:].norm()
    return pose[:3], torch.einsum("pij,p->ij", table, torch.outer(quat, quat).flatten())


class RelativeFeatures(nn.Module):
    """The geometry of one subtask as numbers of order one: observation (..., O) -> (..., out_dim).

    In order, with e_grasp = grip site - grasp point and e_connect = moving connector - target connector:

    - [0:18] the nine cosines of the hand's axes in the grasp frame (row-major), then the nine of the moving
      connector's axes in the target connector's frame;
    - [18:20] cosine and sine of the moving connector's forward axis against the nearest allowed direction about
      the target's up axis (sine positive: a positive turn about up aligns it);
    - [20:32] e_grasp and e_connect in the world, then e_grasp in the grasp frame and e_connect in the target
      connector's frame, over 0.25 m; [32:44] tanh of them over 0.05 m; [44:56] tanh of them over 0.01 m;
    - [56:59] the turn, as axis times sine times cosine in the world, that lays the fingers' line along the grasp's
      (either way round; 0 at a right angle too); [59:62] that which aligns the connectors, as axis times sine, and
      [62:65] the same in the target connector's frame; [65:68] the hand's z axis in the world, in which it approaches;
      [68:80] tanh of these twelve over 0.1;
    - [80:89] tanh of the hand's nine cosines over 0.1: those that should vanish are seen to a degree.

    Args:
        features: of one subtask, from `FurnitureEnv.geometry(subtask)`: moving_part, target_part (index of the
            part in the observation); moving_connector, target_connector, grasp: (7,) position in m and quaternion
            (w, x, y, z) in their part's frame (a connector's up axis is z, its forward axis y; the grasp's x axis is
            the direction in which the fingers close); allowed_angles: (R,) rad about the target's up axis.

    Raises:
        ValueError: if an entry is missing or has the wrong shape.
    """

    keys = ("moving_part", "target_part", "moving_connector", "target_connector", "grasp", "allowed_angles")
    scales = (0.25, 0.05, 0.01)
    turn_scale = 0.1
    out_dim = 89
    quats: Tensor
    points: Tensor
    table: Tensor
    turns: Tensor

    def __init__(self, features: Mapping[str, Any]) -> None:
        super().__init__()
        self._check(features)
        moving, target = int(features["moving_part"]), int(features["target_part"])
        poses = {k: torch.as_tensor(features[k]).double().cpu() for k in self.keys[2:5]}
        angles = torch.as_tensor(features["allowed_angles"]).double().cpu().flatten()
        starts = (HAND_QUAT, PARTS + 7 * moving + 3, PARTS + 7 * target + 3)
        points = (GRIP_POSITION, PARTS + 7 * moving, PARTS + 7 * target)
        self.register_buffer("quats", torch.tensor([[s + k for k in range(4)] for s in starts]))
        self.register_buffer("points", torch.tensor([p + k for p in points for k in range(3)]))
        self.register_buffer("table", self._table(**poses).float())
        # Columns: the cosine, then the sine, of (f_x, f_y) against Rz(a) y = (-sin a, cos a).
        sin, cos = angles.sin(), angles.cos()
        self.register_buffer("turns", torch.stack((torch.cat((-sin, cos)), torch.cat((cos, sin)))).float())

    def _check(self, features: Mapping[str, Any]) -> None:
        missing = [k for k in self.keys if k not in features]
        if missing:
            raise ValueError(f"features lacks {', '.join(missing)}; it has {', '.join(map(str, features))}")
        for key in self.keys[2:5]:
            shape = tuple(torch.as_tensor(features[key]).shape)
            if shape != (7,):
                raise ValueError(f"features[{key!r}] must be a pose of shape (7,), got {shape}")

    @staticmethod
    def _table(moving_connector: Tensor, target_connector: Tensor, grasp: Tensor) -> Tensor:
        """One linear map (57, 42) from [q (x) q of hand, moving, target; grip, moving, target position].

        Its result is two frames (2, 3, 3) of the grasp and the target connector, then (2, 3, 4): beside each
        other, the rotation of the hand and e_grasp; the rotation of the moving connector and e_connect.
        """
        rotation = _products_to_rotation()
        table = torch.zeros(57, 42, dtype=torch.float64)
        frames, columns = table[:, :18].view(57, 2, 3, 3), table[:, 18:].view(57, 2, 3, 4)
        (grasp_pos, grasp_rot), (moving_pos, moving_rot), (target_pos, target_rot) = (
            _frame(pose, rotation) for pose in (grasp, moving_connector, target_connector)
        )
        frames[16:32, 0] = rotation @ grasp_rot
        frames[32:48, 1] = rotation @ target_rot
        columns[0:16, 0, :, :3] = rotation
        columns[16:32, 1, :, :3] = rotation @ moving_rot
        columns[16:32, 0, :, 3] = -(rotation @ grasp_pos)
        columns[16:32, 1, :, 3] = rotation @ moving_pos
        columns[32:48, 1, :, 3] = -(rotation @ target_pos)
        eye = torch.eye(3, dtype=torch.float64)
        columns[48:51, 0, :, 3] = eye
        columns[51:54, 0, :, 3] = -eye
        columns[51:54, 1, :, 3] = eye
        columns[54:57, 1, :, 3] = -eye
        return table

    def forward(self, obs: Tensor) -> Tensor:
        """obs: (..., O) -> (..., out_dim)."""
        quats = obs[..., self.quats]
        products = (quats.unsqueeze(-1) * quats.unsqueeze(-2)).flatten(-3)
        linear = torch.cat((products, obs[..., self.points]), -1) @ self.table
        frames = linear[..., :18].unflatten(-1, (2, 3, 3))
        world = linear[..., 18:].unflatten(-1, (2, 3, 4))
        local = frames.mT @ world  # (..., 2, 3, 4): cosines and errors in the grasp's and the target's frame
        hand_cosines, cosines = local[..., 0, :, :3].flatten(-2), local[..., 1, :, :3].flatten(-2)
        turn = self._nearest_turn(local[..., 1, :2, 1])
        turns = self._remaining_turns(frames, world, local, turn[..., 1])
        errors = torch.cat((world[..., 3].flatten(-2), local[..., 3].flatten(-2)), -1)
        coarse, middle, fine = (errors / scale for scale in self.scales)
        sharp = (torch.cat((turns, hand_cosines), -1) / self.turn_scale).tanh()
        return torch.cat((hand_cosines, cosines, turn, coarse, middle.tanh(), fine.tanh(), turns, sharp), -1)

    def _nearest_turn(self, forward: Tensor) -> Tensor:
        """forward (..., 2): x and y of the forward axis -> (..., 2): cosine and sine to the nearest allowed angle."""
        cosines, sines = (forward @ self.turns).chunk(2, -1)
        nearest, index = cosines.max(-1, keepdim=True)
        return torch.cat((nearest, sines.gather(-1, index)), -1)

    @staticmethod
    def _remaining_turns(frames: Tensor, world: Tensor, local: Tensor, sine: Tensor) -> Tensor:
        """(..., 12): fingers to grasp line, connectors in the world and in the target's frame, hand's z axis."""
        closing, line, up = world[..., 0, :, FINGERS], frames[..., 0, :, 0], local[..., 1, :, 2]
        cosine = (closing * line).sum(-1, keepdim=True)
        grasp = torch.linalg.cross(closing, line) * cosine
        connect = torch.stack((up[..., 1], -up[..., 0], sine), -1)
        turned = (frames[..., 1, :, :] @ connect.unsqueeze(-1)).squeeze(-1)
        return torch.cat((grasp, turned, connect, world[..., 0, :, 2]), -1)
