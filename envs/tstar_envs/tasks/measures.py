"""What is measured on a scene: distances, heights and cosines, all of them at once, one row each.

The reward is a table over these rows (`phase_reward`), so that a control step is a few large operations, not hundreds
of small ones. Simulations come last in every shape here: a row is then one stretch of memory.

Source: docs/task.md, "Dense reward of one subtask" and "Connection".
"""

from __future__ import annotations

from collections.abc import Iterable

import torch
from torch import Tensor

TURNED = {
    "moving": ("connector", "y", "z", "grasp_point", "grasp_axis"),
    "target": ("connector", "x", "y", "z", "way_out"),
}
"""Points and axes that turn with a part, as many for each; x, y and z are its connector's own axes.

`way_out` is the unit vector from the target connector to where the moving one comes from: along the target's axis where
the step's approach says so, straight up otherwise.
"""
POINTS = ("connector", "grasp_point")
VECTORS = {
    name: i
    for i, name in enumerate(
        (
            *(f"{frame}.{row}" for frame, rows in TURNED.items() for row in rows),
            *("moving.origin", "target.origin", "hand.origin", "hand.y", "hand.z"),
            *("start_tip", "start_target", "lift_point"),
            *("grip_direction", "retreat", "up"),
        )
    )
}
"""The hand's origin is the tip. The last six are what the episode's state remembers, and what the recipe asks for:
`retreat` is the unit vector from the grasp point to where the hand waits before it grasps, `up` the world's z axis."""
ABOVE, BELOW = 0.05, 0.015
"""How far from the grasp point the hand waits, along `retreat`, and how far beyond it the tip grasps, m."""

_APART = {
    "tip_to_below": ("hand.origin", "moving.grasp_point", "retreat"),
    "part_to_lift": ("moving.origin", "lift_point", "up"),
    "_tip_to_grasp": ("hand.origin", "moving.grasp_point", "retreat"),
    "tip_to_above": ("hand.origin", "moving.grasp_point", "retreat"),
    "tip_to_start": ("hand.origin", "start_tip", "up"),
    "to_fine": ("moving.connector", "target.connector", "target.way_out"),
    "target_moved": ("target.connector", "start_target", "up"),
    "gap": ("target.connector", "moving.connector", "up"),
}
"""From where to where, and a direction: "to above" and the like are to a point moved along it, see `Measures`."""
_PLANES = ("tip_to_below_plane", "part_to_lift_plane")
_HEIGHTS = ("tip_to_below_height", "part_to_lift_height")
_OVER = ("part_over_lift", "tip_over_grasp")
"""The first rows of `_APART` across their direction, along it, and along it with their signs."""
_DISTANCES = (*_PLANES, *_APART)
_COSINES = {
    "up": ("moving.z", "target.z"),
    "down": ("hand.z", "grip_direction"),
    "turn": ("hand.y", "moving.grasp_axis"),
    "_along": ("moving.y", "target.y"),
    "_across": ("moving.y", "target.x"),
}
_PROJECTIONS = {"moving_projection": "moving.z", "target_projection": "target.z"}
_NAMES = (*_DISTANCES, "forward", *_COSINES, *_PROJECTIONS, *_HEIGHTS, *_OVER)
MEASURES = {name: i for i, name in enumerate(_NAMES)}
"""Rows of what is measured. Distances in m; cosines of angles between axes, of `turn` without the sign, of `forward`
for the best allowed turn; the last two are heights, m, with their signs."""

_GAP, _TURN, _SIDES = len(_DISTANCES) - 1, list(_COSINES).index("turn"), list(_COSINES).index("_along")


class Measures:
    """Measures vectors (3, V, N), named in `VECTORS`; the result is (M, N), named in `MEASURES`.

    Args:
        z_finedist: distance from the target connector, along the way out, at which fine lowering begins, m.
        device: of the vectors.
    """

    def __init__(self, z_finedist: float, device: torch.device):
        moved = {"tip_to_above": ABOVE, "tip_to_below": -BELOW, "to_fine": z_finedist}
        apart = [*list(_APART)[: len(_PLANES)], *_APART]  # `_split` changes the first

        def rows(names: Iterable[str]) -> Tensor:
            return torch.tensor([VECTORS[name] for name in names], device=device)

        columns = zip(*(_APART[name] for name in apart), strict=True)
        self._from, self._to, self._directions = (rows(names) for names in columns)
        distances = [[moved.get(name, 0.0)] for name in apart]
        self._moved = torch.tensor(distances, dtype=torch.float64, device=device)
        self._one, self._other = rows(a for a, _ in _COSINES.values()), rows(b for _, b in _COSINES.values())
        self._ups = rows(_PROJECTIONS.values())
        self._least = torch.tensor(1e-9, dtype=torch.float64, device=device)

    def __call__(self, vectors: Tensor, turns: Tensor) -> Tensor:
        """`turns` (2, R, N) are cosine and negative sine of the turns that count as forward."""
        directions = vectors.index_select(1, self._directions)
        goals = vectors.index_select(1, self._to) + directions * self._moved
        apart = vectors.index_select(1, self._from) - goals
        heights = _split(apart, directions)
        distances = apart.square().sum(0).sqrt()
        cosines = (vectors.index_select(1, self._one) * vectors.index_select(1, self._other)).sum(0)
        cosines[_TURN].abs_()
        forward = (turns * cosines[_SIDES : _SIDES + 2].unsqueeze(1)).sum(0).amax(0, keepdim=True)
        line = apart[:, _GAP] / torch.maximum(distances[_GAP], self._least)
        projections = (vectors.index_select(1, self._ups) * line.unsqueeze(1)).sum(0)
        return torch.cat(
            [distances, forward, cosines, projections, heights[: len(_HEIGHTS)].abs(), heights[1:]]
        )


def _split(apart: Tensor, directions: Tensor) -> Tensor:
    """Heights (3, N) of the first of `_APART` along their directions; leaves of `_PLANES` what is across them."""
    n = len(_PLANES)
    along = directions[:, n : 2 * n + 1]
    heights = (apart[:, n : 2 * n + 1] * along).sum(0)
    apart[:, :n] -= heights[:n] * along[:, :n]
    return heights
