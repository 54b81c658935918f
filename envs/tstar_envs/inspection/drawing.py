"""One PNG of a piece: its parts where they start, what every step makes of them, and the assembled piece alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from tstar_envs.furniture.schema import Furniture
from tstar_envs.inspection.workshop import Workshop
from tstar_envs.rendering import Renderer, make_renderer, write_png
from tstar_envs.robots import sawyer
from tstar_envs.scene import build_spec

HEIGHT, WIDTH, COLUMNS = 270, 360, 3
_CONNECTOR, _GRASP = (0.85, 0.1, 0.1, 1), (0.1, 0.25, 0.85, 1)
_NEAR, _ALL = "near", "all"


def sheet(furniture: Furniture) -> np.ndarray | None:
    """Picture (height, width, 3) uint8: the start, each step's target pose, the piece; None where nothing is drawn.

    Connectors are red, where the fingers touch is blue; the part that a step moves is where it belongs.
    """
    shots = [(_ALL, 0), *((_ALL, k + 1) for k in range(len(furniture.steps))), (_NEAR, len(furniture.steps))]
    return _shots(furniture, shots, marks=True)


def portrait(furniture: Furniture) -> np.ndarray | None:
    """A small picture: the parts where they start, and the assembled piece; None where nothing is drawn."""
    return _shots(furniture, [(_ALL, 0), (_NEAR, len(furniture.steps))], marks=False)


def write(furniture: Furniture, path: str | Path, small: bool = False) -> bool:
    """Writes the sheet, or the small portrait; False where nothing can be drawn here."""
    image = portrait(furniture) if small else sheet(furniture)
    if image is None:
        return False
    write_png(path, image)
    return True


def _shots(furniture: Furniture, shots: Sequence[tuple[str, int]], marks: bool) -> np.ndarray | None:
    workshop = Workshop(furniture)
    poses, model = workshop.nominal, _model(workshop, marks)
    images = []
    for camera in (_ALL, _NEAR):
        renderer = make_renderer(model, HEIGHT, WIDTH, camera)
        if renderer is None:
            return None
        images += [(i, _draw(renderer, poses[k])) for i, (name, k) in enumerate(shots) if name == camera]
        renderer.close()
    ordered = [image for _, image in sorted(images, key=lambda each: each[0])]
    columns = min(COLUMNS, len(ordered))
    ordered += [np.full_like(ordered[0], 255)] * (-len(ordered) % columns)
    rows = [np.concatenate(ordered[i : i + columns], axis=1) for i in range(0, len(ordered), columns)]
    return np.concatenate(rows, axis=0)


def _draw(renderer: Renderer, poses: np.ndarray) -> np.ndarray:
    arm = [*sawyer.HOME_QPOS, *sawyer.FINGER_OPEN]
    return renderer.draw(np.concatenate([arm, poses.ravel()])).copy()


def _model(workshop: Workshop, marks: bool) -> mujoco.MjModel:
    """The scene with the arm out of sight, marks on the parts, and two cameras that hold all parts, or the piece."""
    furniture = workshop.furniture
    spec = build_spec(furniture)
    parts = set(furniture.part_names)
    for body in spec.bodies:
        for drawn in (*body.geoms, *body.sites):
            if body.name not in parts and drawn.name != "floor":
                drawn.rgba = (0, 0, 0, 0)
    if marks:
        _add_marks(spec, furniture)
    everything = list(range(len(furniture.parts)))
    joined = {
        furniture.part_index(name)
        for step in furniture.steps
        for name in (step.moving_part, step.target_part)
    }
    workshop.place(workshop.nominal[0])
    _add_camera(spec, _ALL, workshop.corners(everything))
    workshop.place(workshop.nominal[-1])
    _add_camera(spec, _NEAR, workshop.corners(sorted(joined)))
    return spec.compile()


def _add_marks(spec: mujoco.MjSpec, furniture: Furniture) -> None:
    sphere = mujoco.mjtGeom.mjGEOM_SPHERE
    for part in furniture.parts:
        body = spec.body(part.name)
        for connector in part.connectors:
            body.add_site(type=sphere, size=(0.009, 0, 0), pos=connector.pos, rgba=_CONNECTOR)
        for grasp in part.grasps:
            for side in (-0.02, 0.02):
                point = [p + side * a for p, a in zip(grasp.point, grasp.axis, strict=True)]
                body.add_site(type=sphere, size=(0.007, 0, 0), pos=point, rgba=_GRASP)


def _add_camera(spec: mujoco.MjSpec, name: str, points: np.ndarray) -> None:
    """A camera that looks from the front at everything between `points` (n, 3), m, world."""
    low, high = points.min(axis=0), points.max(axis=0)
    back = np.array([0.45, -0.72, 0.53])
    right = np.array([0.72, 0.45, 0.0]) / np.hypot(0.72, 0.45)
    up = np.cross(back / np.linalg.norm(back), right)
    off = 1.02 * float(np.linalg.norm(high - low))
    spec.worldbody.add_camera(name=name, pos=(low + high) / 2 + off * back, xyaxes=[*right, *up], fovy=45)
