"""The scene as it is drawn: the simulated one with an arm that looks like one, materials, a floor and light.

It has the bodies, joints and state of `scene.build_model`, so a `qpos` of one is a `qpos` of the other, and stepping
either gives the same bits. Simulations run on `scene.build_model` all the same: what is drawn alone costs time there.
"""

from __future__ import annotations

import mujoco

from tstar_envs.furniture.schema import Furniture
from tstar_envs.rendering import CAMERA
from tstar_envs.robots import sawyer_look
from tstar_envs.scene import build_spec, compiled

FLOOR_TILE = 0.5
"""Side of a floor tile, m."""


def build_drawn_spec(furniture: Furniture) -> mujoco.MjSpec:
    """Returns the editable scene of `furniture` with everything that is only drawn."""
    spec = build_spec(furniture)
    sawyer_look.add_look(spec)
    _add_floor(spec)
    _add_light(spec)
    _step_back(spec.camera(CAMERA))
    return spec


def build_drawn_model(furniture: Furniture) -> mujoco.MjModel:
    """Compiles the scene of `furniture` to draw: for renderers, viewers and players."""
    return compiled(build_drawn_spec(furniture), furniture.name)


def _add_floor(spec: mujoco.MjSpec) -> None:
    spec.add_texture(
        name="tiles", type=mujoco.mjtTexture.mjTEXTURE_2D, builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT,
        mark=mujoco.mjtMark.mjMARK_EDGE, rgb1=(0.8, 0.82, 0.84), markrgb=(0.68, 0.71, 0.74), width=256, height=256,
    )  # fmt: skip
    material = spec.add_material(name="floor", texuniform=True, texrepeat=(1 / FLOOR_TILE, 1 / FLOOR_TILE))
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB.value] = "tiles"
    material.specular, material.shininess, material.reflectance = 0.1, 0.1, 0.0
    spec.geom("floor").material = "floor"
    spec.geom("floor").rgba = (0.5, 0.5, 0.5, 1)  # MuJoCo's default: the material's own colour counts


def _add_light(spec: mujoco.MjSpec) -> None:
    """A key light that throws shadows, a weaker one from behind, and little light from the camera."""
    head = spec.visual.headlight
    head.ambient, head.diffuse, head.specular = (0.32, 0.32, 0.33), (0.22, 0.22, 0.22), (0.1, 0.1, 0.1)
    for light in spec.worldbody.lights:
        light.pos, light.dir = (-0.8, -1.2, 2.6), (0.3, 0.55, -1)
        light.diffuse, light.specular = (0.6, 0.59, 0.56), (0.4, 0.4, 0.4)
    spec.worldbody.add_light(
        pos=(1.5, 1.5, 2), dir=(-0.6, -0.6, -0.7), type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, castshadow=False,
        diffuse=(0.18, 0.19, 0.22), specular=(0.1, 0.1, 0.1),
    )  # fmt: skip
    spec.visual.rgba.haze = (0.87, 0.9, 0.93, 1)  # at the horizon, as bright as the sky
    quality = spec.visual.quality
    quality.shadowsize = (
        2048  # half MuJoCo's, and fewer facets: a frame takes 1.2 times that of the bare scene, not 2
    )
    quality.numslices, quality.numstacks = 20, 12


def _step_back(camera: mujoco.MjsCamera) -> None:
    """Puts the camera where the raised arm and its pedestal are in the picture."""
    camera.pos, camera.fovy = (-1.04, -1.25, 0.965), 42
    camera.alt.type = mujoco.mjtOrientation.mjORIENTATION_XYAXES
    camera.alt.xyaxes = (0.848, -0.530, 0, 0.181, 0.290, 0.940)
