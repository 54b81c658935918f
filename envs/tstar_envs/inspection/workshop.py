"""The scene of one piece of furniture, posed at will: gaps between parts, thickness at a grasp, heights, masses."""

from __future__ import annotations

import mujoco
import numpy as np
import torch

from tstar_envs.furniture.schema import Furniture
from tstar_envs.robots import sawyer
from tstar_envs.scene import build_model
from tstar_envs.tasks.recipe_tables import RecipeTables

FAR = 0.1
"""m: gaps are looked for up to this; anything further off counts as far."""
ASIDE = 0.05
"""m: from the middle between the open fingers to beyond either of them, whose far sides are 48 mm off."""
_PART_GROUP = 5
_ASIDE = np.array([6e-6, -6.4e-6, 4.8e-6])
"""m: 1e-5 in a direction of no axis. Two geoms with one centre are moved apart by it before they are measured."""


class Workshop:
    """One MuJoCo model of a piece; `place` poses its parts, everything else reads the poses placed last.

    Lengths in m, world frame.
    """

    def __init__(self, furniture: Furniture):
        self.furniture = furniture
        self.model = build_model(furniture)
        self.data = mujoco.MjData(self.model)
        self.tables = RecipeTables(furniture, torch.device("cpu"))
        self.nominal = self.tables.nominal_poses().numpy()
        """(K + 1, parts, 7): as each step begins and after the last."""
        self._geoms = [self._geoms_of(part.name) for part in furniture.parts]
        self._hand = self._geoms_of("right_l5", "hand", *sawyer.FINGERS)
        self.place(self.nominal[0])

    def place(self, poses: np.ndarray) -> None:
        """Puts the parts at `poses` (parts, 7) and the arm at home."""
        home = [*sawyer.HOME_QPOS, *sawyer.FINGER_OPEN]
        self.data.qpos[:] = np.concatenate([home, poses.ravel()])
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)

    def gap(self, one: int, other: int) -> float:
        """Least distance of two parts, at most `FAR`; negative where one is inside the other."""
        return self._gap(self._geoms[one], self._geoms[other])

    def gap_to_hand(self, part: int) -> float:
        """Least distance of a part to the hand, its fingers and the wrist."""
        return self._gap(self._geoms[part], self._hand)

    def lowest(self, part: int) -> float:
        """Height of a part's lowest point."""
        return min(self._lowest(geom) for geom in self._geoms[part])

    def corners(self, parts: list[int]) -> np.ndarray:
        """Points (n, 3) between which `parts` lie: two corners for each shape, .8 of its bounding radius off."""
        geoms = [geom for part in parts for geom in self._geoms[part]]
        reach = self.model.geom_rbound[geoms, None] * 0.8
        middle = self.data.geom_xpos[geoms]
        return np.concatenate([middle - reach, middle + reach])

    def off_surface(self, part: int, point: np.ndarray) -> float:
        """How far a point (3,) of the part's frame is from its nearest shape, 0 inside one."""
        body = self.model.body(self.furniture.parts[part].name).id
        world = self.data.xpos[body] + self.data.xmat[body].reshape(3, 3) @ point
        return min(self._off_geom(geom, world) for geom in self._geoms[part])

    def thickness(self, parts: list[int], point: np.ndarray, axis: np.ndarray) -> tuple[float, float] | None:
        """Surfaces of `parts` met from either side along `axis`, as distances from `point`; None if one is missed.

        They are looked for from where the fingers come down, `ASIDE` to either side, so that another bar beside that is
        not taken for the one between them; and from `FAR`, where they come down inside a part or have nothing between
        them, to say how wide it is, or how far aside.
        """
        return self._surfaces(parts, point, axis, ASIDE) or self._surfaces(parts, point, axis, FAR)

    def _surfaces(
        self, parts: list[int], point: np.ndarray, axis: np.ndarray, reach: float
    ) -> tuple[float, float] | None:
        """`thickness` from `reach` to either side: what lies beyond, or there, is not between the fingers."""
        geoms = [geom for part in parts for geom in self._geoms[part]]
        if any(self._off_geom(geom, point + end * axis) == 0 for geom in geoms for end in (-reach, reach)):
            return None
        self.model.geom_group[:] = 0
        self.model.geom_group[geoms] = _PART_GROUP
        group = np.zeros(6, dtype=np.uint8)
        group[_PART_GROUP] = 1
        found = []
        for side in (-1.0, 1.0):
            start, hit = point + side * reach * axis, np.zeros(1, dtype=np.int32)
            length = mujoco.mj_ray(self.model, self.data, start, -side * axis, group, 0, -1, hit, None)
            if length < 0 or length > 2 * reach:
                return None
            found.append(reach - length)
        return found[0], found[1]

    def mass(self, part: int) -> float:
        """Mass of a part, kg."""
        return float(self.model.body(self.furniture.parts[part].name).mass[0])

    def group(self, step: int) -> list[int]:
        """The moving part of a step and what is welded to it by then."""
        return self.tables.group[step].nonzero().flatten().tolist()

    def _geoms_of(self, *bodies: str) -> list[int]:
        ids = {self.model.body(name).id for name in bodies}
        return [i for i in range(self.model.ngeom) if self.model.geom_bodyid[i] in ids]

    def _gap(self, these: list[int], those: list[int]) -> float:
        return min(self._distance(i, j) for i in these for j in those)

    def _distance(self, one: int, other: int) -> float:
        """Least distance of two geoms.

        MuJoCo overlooks how deep some are in each other: those that lie on one axis, which a step aside shows, and a
        capsule whose axis is in a box, which is as deep as it is thick.
        """
        ends, place = np.zeros(6), self.data.geom_xpos[one]
        found = mujoco.mj_geomDistance(self.model, self.data, one, other, FAR, ends)
        place += _ASIDE
        found = min(found, mujoco.mj_geomDistance(self.model, self.data, one, other, FAR, ends))
        place -= _ASIDE
        return min(found, self._axis_inside(one, other), self._axis_inside(other, one))

    def _axis_inside(self, capsule: int, box: int) -> float:
        """Less its radius, if the axis of a capsule is in a box anywhere; else `FAR`. Other shapes: `FAR`."""
        kinds = self.model.geom_type[[capsule, box]].tolist()
        if kinds != [mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_BOX]:
            return FAR
        radius, half, _ = self.model.geom_size[capsule]
        along = self.data.geom_xmat[capsule].reshape(3, 3)[:, 2]
        axis = self.data.geom_xpos[capsule] + np.linspace(-half, half, 101)[:, None] * along
        return -radius if any(self._off_geom(box, point) == 0 for point in axis) else FAR

    def _lowest(self, geom: int) -> float:
        size, up = self.model.geom_size[geom], np.abs(self.data.geom_xmat[geom].reshape(3, 3)[2])
        kind, height = self.model.geom_type[geom], self.data.geom_xpos[geom][2]
        if kind == mujoco.mjtGeom.mjGEOM_BOX:
            return float(height - up @ size)
        ends = size[1] * up[2]
        round_part = size[0] if kind == mujoco.mjtGeom.mjGEOM_CAPSULE else size[0] * np.hypot(up[0], up[1])
        return float(height - ends - round_part)

    def _off_geom(self, geom: int, point: np.ndarray) -> float:
        size, kind = self.model.geom_size[geom], self.model.geom_type[geom]
        local = self.data.geom_xmat[geom].reshape(3, 3).T @ (point - self.data.geom_xpos[geom])
        if kind == mujoco.mjtGeom.mjGEOM_BOX:
            return float(np.linalg.norm(np.maximum(np.abs(local) - size, 0)))
        beyond, aside = max(abs(local[2]) - size[1], 0.0), np.hypot(local[0], local[1])
        if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
            return float(max(np.hypot(beyond, aside) - size[0], 0.0))
        return float(np.hypot(beyond, max(aside - size[0], 0.0)))
