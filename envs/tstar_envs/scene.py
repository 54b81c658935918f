"""Furniture + robot -> one compiled MjModel that serves every subtask.

Bodies are named as the parts of the furniture. Every weld of the assembly is compiled in, inactive, one per step
and named `step_<i>`: body1 is the target part, body2 the moving part. What changes during an episode lives in the
state (`eq_active`) and in the per-simulation `eq_data`, nothing else in the model does.
"""

from __future__ import annotations

import mujoco

from tstar_envs.furniture.errors import FurnitureError
from tstar_envs.furniture.schema import Furniture, Part
from tstar_envs.furniture.shapes import Box, Capsule, Cylinder
from tstar_envs.robots import sawyer

TIMESTEP = 0.01
SUBSTEPS = 10
"""10 physics steps of 10 ms a control step: 10 Hz control (docs/decisions/0005-physics.md)."""
LARGEST_IMAGE = 1280, 960
"""Width and height in pixels: no picture of the scene can be larger."""

_GEOM_TYPES = {
    Box: mujoco.mjtGeom.mjGEOM_BOX,
    Cylinder: mujoco.mjtGeom.mjGEOM_CYLINDER,
    Capsule: mujoco.mjtGeom.mjGEOM_CAPSULE,
}
_PART_COLOURS = ((0.85, 0.65, 0.4, 1), (0.4, 0.6, 0.8, 1), (0.5, 0.75, 0.45, 1), (0.8, 0.5, 0.55, 1))
_TARGET_COLOUR = (0.93, 0.9, 0.84, 1)


def build_spec(furniture: Furniture) -> mujoco.MjSpec:
    """Returns the editable scene: floor, robot, parts, welds, sensors, camera and light.

    Raises:
        FurnitureError: a part has a name that the robot or the world has.
    """
    spec = mujoco.MjSpec()
    spec.modelname = furniture.name
    spec.compiler.degree = False
    _set_options(spec)
    floor = {"type": mujoco.mjtGeom.mjGEOM_PLANE, "size": (0, 0, 0.05), "friction": (2.0, 0.005, 0.0001)}
    spec.worldbody.add_geom(
        name="floor",
        contype=sawyer.WORLD_BIT,
        conaffinity=sawyer.PART_BIT,
        rgba=(0.75, 0.78, 0.8, 1),
        **floor,
    )
    sawyer.add_sawyer(spec)
    _check_names(spec, furniture)
    targets = {step.target_part for step in furniture.steps}
    for i, part in enumerate(furniture.parts):
        colour = _TARGET_COLOUR if part.name in targets else _PART_COLOURS[i % len(_PART_COLOURS)]
        _add_part(spec, part, colour, furniture.contact_impedance)
    for one, other in furniture.no_contact:
        spec.add_exclude(bodyname1=one, bodyname2=other)
    _add_welds(spec, furniture)
    _add_contact_sensors(spec, furniture)
    _add_view(spec)
    return spec


def build_model(furniture: Furniture) -> mujoco.MjModel:
    """Compiles the scene of `furniture`.

    Raises:
        FurnitureError: what `build_spec` raises; or MuJoCo does not take the scene, as with parts that weigh nothing.
    """
    return compiled(build_spec(furniture), furniture.name)


def compiled(spec: mujoco.MjSpec, name: str) -> mujoco.MjModel:
    """Compiles the scene of the furniture `name`.

    Raises:
        FurnitureError: MuJoCo does not take it.
    """
    try:
        return spec.compile()
    except ValueError as error:
        said = " ".join(str(error).split())
        raise FurnitureError(f"{name}: MuJoCo does not take its scene: {said}") from None


def scene_xml(furniture: Furniture) -> str:
    """The scene of `furniture` as XML that compiles by itself, for other programs.

    A model read from it has the same joints, sensors and states. Its numbers may differ from `build_model`'s in the
    last bit, so whoever wants the same future to the bit builds the scene from the furniture.
    """
    spec = build_spec(furniture)
    model = compiled(spec, furniture.name)
    for body in spec.bodies:
        if (
            body.explicitinertial
        ):  # one whose place was left to the compiler would be written without its mass
            body.ipos, body.iquat = model.body(body.name).ipos, model.body(body.name).iquat
    spec.compile()
    return spec.to_xml()


def _check_names(spec: mujoco.MjSpec, furniture: Furniture) -> None:
    taken = {one.name for one in (*spec.bodies, *spec.joints)} - {""}
    for part in furniture.parts:
        if part.name in taken:
            others = ", ".join(sorted(taken))
            raise FurnitureError(
                f"parts.{part.name}: the scene has this name; call the part otherwise, and not {others}"
            )


def _set_options(spec: mujoco.MjSpec) -> None:
    option = spec.option
    option.timestep = TIMESTEP
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.iterations, option.ls_iterations, option.impratio = 30, 20, 1
    option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    spec.visual.global_.offwidth, spec.visual.global_.offheight = LARGEST_IMAGE


def _add_part(spec: mujoco.MjSpec, part: Part, colour: tuple[float, ...], impedance: float | None) -> None:
    body = spec.worldbody.add_body(name=part.name, pos=part.initial_pose[:3], quat=part.initial_pose[3:])
    body.add_joint(name=part.name, type=mujoco.mjtJoint.mjJNT_FREE, damping=1e-4)
    for shape in part.shapes:
        geom = body.add_geom(
            type=_GEOM_TYPES[type(shape)], size=shape.size, pos=shape.pos, quat=shape.quat, density=part.density,
            contype=sawyer.PART_BIT, conaffinity=sawyer.PART_BIT | sawyer.WORLD_BIT, friction=(0.8, 0.005, 0.0001),
            rgba=colour,
        )  # fmt: skip
        if impedance is not None:
            geom.solimp[:2] = impedance
            geom.solmix = 1000.0  # the part's stiffness counts, whatever it touches


def _add_welds(spec: mujoco.MjSpec, furniture: Furniture) -> None:
    for i, step in enumerate(furniture.steps):
        weld = spec.add_equality(
            name=f"step_{i}", type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_BODY,
            name1=step.target_part, name2=step.moving_part, active=False, solref=(0.02, 1),
        )  # fmt: skip
        weld.data[:3] = 0.0  # the anchor; MjSpec's default is meant for joint equalities
        if furniture.weld_impedance is not None:
            weld.solimp[:2] = furniture.weld_impedance


def _add_contact_sensors(spec: mujoco.MjSpec, furniture: Furniture) -> None:
    """One sensor per finger and part, in that order: the number of contacts between the two."""
    for finger in sawyer.FINGERS:
        for part in furniture.parts:
            spec.add_sensor(
                name=f"{finger}_touches_{part.name}", type=mujoco.mjtSensor.mjSENS_CONTACT,
                objtype=mujoco.mjtObj.mjOBJ_BODY, objname=finger, reftype=mujoco.mjtObj.mjOBJ_BODY,
                refname=part.name, intprm=(1 << mujoco.mjtConDataField.mjCONDATA_FOUND.value, 0, 1),
            )  # fmt: skip


def _add_view(spec: mujoco.MjSpec) -> None:
    spec.add_texture(
        name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=(0.93, 0.95, 0.97), rgb2=(0.7, 0.76, 0.82), width=32, height=192,
    )  # fmt: skip
    spec.worldbody.add_light(pos=(0, -1, 2.5), dir=(0, 0.4, -1), type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL)
    spec.worldbody.add_camera(
        name="workplace", pos=(-0.95, -1.1, 0.85), fovy=48, xyaxes=(0.842, -0.539, 0, 0.211, 0.329, 0.920)
    )
