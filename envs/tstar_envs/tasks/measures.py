"""What is measured on a scene: distances, heights and cosines, all of them at once, one row each.

The reward is a table over these rows (`phase_reward`), so that a control step is a few large operations, not hundreds
of small ones. Simulations come last in every shape here: a row is then one stretch of memory.

Source: docs/task.md, "Dense reward of one subtask" and "Connecting".
"""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor

TURNED = {
    "moving": ("connector", "y", "z", "grasp_point", "grasp_axis"),
    "target": ("connector", "x", "y", "z"),
}
"""Points and axes that turn with a part; x, y and z are its connector's own axes."""
POINTS = ("connector", "grasp_point")
VECTORS = {
    name: i
    for i, name in enumerate(
        (
            *(f"{frame}.{row}" for frame, rows in TURNED.items() for row in rows),
            *("moving.origin", "target.origin", "hand.origin", "hand.y", "hand.z"),
            *("start_tip", "start_target", "lift_point", "grip_direction"),
        )
    )
}
"""The hand's origin is the tip. The last four are what the episode's state remembers, and what the recipe asks for."""
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
_HEIGHTS = {
    "tip_over_grasp": ("hand.origin", "moving.grasp_point", "z"),
    "part_over_lift": ("moving.origin", "lift_point", "z"),
}
_NAMES = (*_DISTANCES, "forward", *_COSINES, *_PROJECTIONS, *_HEIGHTS)
MEASURES = {name: i for i, name in enumerate(_NAMES)}
"""Rows of what is measured. Distances in m; cosines of angles between axes, of `turn` without the sign, of `forward`
for the best allowed turn; the last two are heights, m, with their signs."""

_GAP, _TURN, _SIDES = len(_DISTANCES) - 1, list(_COSINES).index("turn"), list(_COSINES).index("_along")


class Measures:
    """Measures vectors (3, V, N), named in `VECTORS`; the result is (M, N), named in `MEASURES`.

    Args:
        z_finedist: height above the target connector at which fine lowering begins, m.
        device: of the vectors.
    """

    def __init__(self, z_finedist: float, device: torch.device):
        pairs = [*_DISTANCES.values(), *_HEIGHTS.values()]
        raised = {"tip_to_above": ABOVE, "to_fine": z_finedist}
        raised |= dict.fromkeys(("tip_to_below", "tip_to_below_plane", "tip_to_below_height"), -BELOW)

        def rows(names: Iterable[str]) -> Tensor:
            return torch.tensor([VECTORS[name] for name in names], device=device)

        def table(values: list[list[float]]) -> Tensor:  # (3, rows, 1)
            return torch.tensor(values, dtype=torch.float64, device=device).t().unsqueeze(-1).contiguous()

        self._from, self._to = rows(a for a, _, _ in pairs), rows(b for _, b, _ in pairs)
        self._raise = table([[0.0, 0.0, raised.get(name, 0.0)] for name in [*_DISTANCES, *_HEIGHTS]])
        self._counts = table([[float(axis in axes) for axis in "xyz"] for _, _, axes in pairs])
        self._one, self._other = rows(a for a, _ in _COSINES.values()), rows(b for _, b in _COSINES.values())
        self._ups = rows(_PROJECTIONS.values())
        self._least = torch.tensor(1e-9, dtype=torch.float64, device=device)

    def __call__(self, vectors: Tensor, turns: Tensor) -> Tensor:
        """`turns` (2, R, N) are cosine and negative sine of the turns that count as forward."""
        apart = vectors.index_select(1, self._from) - (vectors.index_select(1, self._to) + self._raise)
        apart = apart * self._counts
        distances = apart[:, : len(_DISTANCES)].square().sum(0).sqrt()
        cosines = (vectors.index_select(1, self._one) * vectors.index_select(1, self._other)).sum(0)
        cosines[_TURN].abs_()
        forward = (turns * cosines[_SIDES : _SIDES + 2].unsqueeze(1)).sum(0).amax(0, keepdim=True)
        line = apart[:, _GAP] / torch.maximum(distances[_GAP], self._least)
        projections = (vectors.index_select(1, self._ups) * line.unsqueeze(1)).sum(0)
        return torch.cat([distances, forward, cosines, projections, apart[2, len(_DISTANCES) :]])
