"""How far apart two poses of one part are."""

import torch
from torch import Tensor

from tstar_rl.env.layout import NUM_PHASES, PARTS

__all__ = ["angles_between", "apart", "part_poses"]


def part_poses(observation: Tensor) -> Tensor:
    """Poses (N, P, 7) of all parts in observations (N, O), on the processor: position (m), quaternion (w, x, y, z)."""
    return observation.cpu()[:, PARTS:-NUM_PHASES].unflatten(-1, (-1, 7))


def apart(name: str, first: Tensor, second: Tensor) -> dict[str, float]:
    """The columns <name>_moved (m) and <name>_turned (degrees) between two poses (7,)."""
    moved, turned = (second[:3] - first[:3]).norm(), angles_between(first[3:].double(), second[3:].double())
    return {f"{name}_moved": round(float(moved), 4), f"{name}_turned": round(float(turned), 2)}


def angles_between(first: Tensor, second: Tensor) -> Tensor:
    """Degrees (...) between orientations (..., 4) and (..., 4) or (4,); q and -q are one orientation."""
    chord = torch.minimum((first - second).norm(dim=-1), (first + second).norm(dim=-1))
    return torch.rad2deg(4 * torch.asin((chord / 2).clamp(max=1)))
