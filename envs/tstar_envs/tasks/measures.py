"""What is measured on a scene: distances, heights and cosines, all of them at once, one column each.

The reward is a table over these columns (`phase_reward`), so that a control step is a few large operations, not
hundreds of small ones. Source: environment.md, "Dense reward of one subtask" and "Connecting".
"""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor

FRAMES = ("moving", "target", "hand")
ROWS = ("origin", "connector", "x", "y", "z", "grasp_point", "grasp_axis")
"""Points and axes that turn with each frame; x, y and z are the connector's own axes, or the hand's."""
POINTS = ("origin", "connector", "grasp_point")
REMEMBERED = ("start_tip", "start_target", "lift_point", "grip_direction")
"""Points that the episode's state remembers, and the approach direction that the recipe asks for."""
VECTORS = {
    name: i for i, name in enumerate([*(f"{frame}.{row}" for frame in FRAMES for row in ROWS), *REMEMBERED])
}
ABOVE, BELOW = 0.05, 0.015
"""Height of the way point above the grasp point, and of the grasping tip below it, m."""

_DISTANCES = {
    "tip_to_start": ("hand.origin", "start_tip", "xyz"),
    "tip_to_above": ("hand.origin", "moving.grasp_point", "xyz"),
    "tip_to_below": ("hand.origin", "moving.grasp_point", "xyz"),
    "tip_to_below_plane": ("hand.origin", "moving.grasp_point", "xy"),
    "tip_to_below_height": ("hand.origin", "moving.grasp_point", "z"),
    "part_to_lift": ("moving.origin", "lift_point", "xyz"),
    "part_to_lift_plane": ("moving.origin", "lift_point", "xy"),
    "part_to_lift_height": ("moving.origin", "lift_point", "z"),
    "to_fine": ("moving.connector", "target.connector", "xyz"),
    "target_moved": ("target.connector", "start_target", "xyz"),
    "gap": ("target.connector", "moving.connector", "xyz"),
}
"""From where to where, and which components count; "to above" and the like are to a point raised by `_raised`."""
_COSINES = {
    "up": ("moving.z", "target.z"),
    "down": ("hand.z", "grip_direction"),
    "turn": ("hand.y", "moving.grasp_axis"),
    "_along": ("moving.y", "target.y"),
    "_across": ("moving.y", "target.x"),
}
_PROJECTIONS = {"moving_projection": "moving.z", "target_projection": "target.z"}
_NAMES = (*_DISTANCES, "forward", *_COSINES, *_PROJECTIONS, "tip_over_grasp")
MEASURES = {name: i for i, name in enumerate(_NAMES)}
"""Columns of what is measured. Distances in m; cosines of angles between axes; `turn` without its sign; `forward` for
the best allowed turn; `tip_over_grasp` is a height, m, with its sign."""

_GAP, _TURN, _SIDES = len(_DISTANCES) - 1, list(_COSINES).index("turn"), list(_COSINES).index("_along")


class Measures:
    """Measures vectors (N, V, 3), named in `VECTORS`; the result is (N, M), named in `MEASURES`.

    Args:
        z_finedist: height above the target connector at which fine lowering begins, m.
        allowed_angles: (K, R), rad: the turns of each step that count as forward.
        device: of the vectors.
    """

    def __init__(self, z_finedist: float, allowed_angles: Tensor, device: torch.device):
        over = "hand.origin", "moving.grasp_point", "z"  # the last row: its sign is wanted
        pairs = [*_DISTANCES.values(), over]
        raised = {"tip_to_above": ABOVE, "to_fine": z_finedist}
        raised |= dict.fromkeys(("tip_to_below", "tip_to_below_plane", "tip_to_below_height"), -BELOW)

        def rows(names: Iterable[str]) -> Tensor:
            return torch.tensor([VECTORS[name] for name in names], device=device)

        def table(values: list[list[float]]) -> Tensor:
            return torch.tensor(values, dtype=torch.float64, device=device)

        self._from, self._to = rows(a for a, _, _ in pairs), rows(b for _, b, _ in pairs)
        self._raise = table([[0.0, 0.0, raised.get(name, 0.0)] for name in [*_DISTANCES, "over"]])
        self._counts = table([[float(axis in axes) for axis in "xyz"] for _, _, axes in pairs])
        self._one, self._other = rows(a for a, _ in _COSINES.values()), rows(b for _, b in _COSINES.values())
        self._along_line = rows(_PROJECTIONS.values())
        self._turns = torch.stack([allowed_angles.cos(), -allowed_angles.sin()], dim=1)  # (K, 2, R)

    def __call__(self, vectors: Tensor, step: Tensor) -> Tensor:
        """`step` is (N,): which row of the allowed angles each simulation is at."""
        apart = vectors.index_select(1, self._from) - (vectors.index_select(1, self._to) + self._raise)
        apart = apart * self._counts
        distances = torch.linalg.vector_norm(apart[:, :-1], dim=-1)
        cosines = (vectors.index_select(1, self._one) * vectors.index_select(1, self._other)).sum(-1)
        cosines[:, _TURN].abs_()
        turned = self._turns.index_select(0, step) * cosines[:, _SIDES : _SIDES + 2].unsqueeze(-1)
        forward = turned.sum(1).amax(-1, keepdim=True)
        gap = slice(_GAP, _GAP + 1)
        line = apart[:, gap] / distances[:, gap].clamp_min(1e-9).unsqueeze(-1)
        projections = (vectors.index_select(1, self._along_line) * line).sum(-1)
        return torch.cat([distances, forward, cosines, projections, apart[:, -1, 2:]], dim=-1)
