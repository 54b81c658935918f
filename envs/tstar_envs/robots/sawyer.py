"""The Sawyer arm and its two-finger gripper as MuJoCo bodies.

Kinematics, inertias, joint limits and velocity limits are the manufacturer's. What departs from the original
environment, each measured to hold a grasp better or to step faster:

* stiffer velocity servos and a joint armature of 0.05 kg m^2 (the original's gains are sluggish);
* thin, set-back finger links, so that a grasped part touches pads only;
* collision geometry on the wrist, the hand and the fingers alone: nothing else of the arm comes near the work.

The finger pads are the original's boxes: capsules lose the part at this timestep (12 to 72% scripted success against
100%). The hand's collision shape departs without a measurement: a cylinder 40 mm long along the approach axis, where
the original's is 100 mm long along the closing axis.

Source: docs/task.md, "Scene" and "Physics"; docs/decisions/0005-physics.md.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco

BASE_POS = (0.0, 0.65, 0.213)
BASE_QUAT = (0.707107, 0.0, 0.0, -0.707107)
HOME_QPOS = (-0.28, -0.6, 0.0, 1.86, 0.0, 0.3, 1.57)
"""Joint angles of the arm at the start of every subtask, rad."""

NUM_JOINTS = 7
NUM_QPOS = NUM_JOINTS + 2
"""Joints and fingers: the first entries of a scene's qpos, and of its qvel."""
FINGER_OPEN = (0.020833, -0.020833)
FINGER_CLOSED = (-0.0115, 0.0115)
"""Targets of the (left, right) finger slides, m."""

FINGERS = ("left_finger", "right_finger")
ARMATURE = 0.05

# Bits of MuJoCo's contype / conaffinity.
WORLD_BIT, PART_BIT, PAD_BIT = 1, 2, 4


class Link(NamedTuple):
    """One revolute link: frame in its parent, inertia, joint range (rad), speed limit (rad/s), servo gain."""

    name: str
    pos: tuple[float, ...]
    quat: tuple[float, ...]
    mass: float
    com: tuple[float, ...]
    inertia_quat: tuple[float, ...]
    inertia: tuple[float, ...]
    limit: tuple[float, float]
    speed: float
    gain: float
    damping: float = 0.0


LINKS = (
    Link("right_l0", (0, 0, 0.08), (1, 0, 0, 0), 5.3213, (0.024366, 0.010969, 0.14363),
         (0.894823, 0.009, -0.170275, 0.412573), (0.065159, 0.051094, 0.018622), (-3.0503, 3.0503), 1.74, 80.0),
    Link("right_l1", (0.081, 0.05, 0.237), (0.5, -0.5, 0.5, 0.5), 4.505, (-0.003085, -0.026811, 0.092521),
         (0.424888, 0.891987, 0.132364, -0.07943), (0.022434, 0.022162, 0.00971), (-3.8095, 2.2736), 1.328, 80.0),
    Link("right_l2", (0, -0.14, 0.1425), (0.707107, 0.707107, 0, 0), 1.745, (-0.00016, -0.014967, 0.13582),
         (0.707831, -0.052476, 0.051601, 0.702537), (0.025793, 0.025506, 0.002925), (-3.0426, 3.0426), 1.957, 60.0),
    Link("right_l3", (0, -0.042, 0.26), (0.707107, -0.707107, 0, 0), 2.5097, (-0.004814, -0.0281, -0.084154),
         (0.902999, 0.385391, -0.08809, 0.168247), (0.01024, 0.0097, 0.003696), (-3.0439, 3.0439), 1.957, 50.0),
    Link("right_l4", (0, -0.125, -0.1265), (0.707107, 0.707107, 0, 0), 1.1136, (-0.001884, 0.0069, 0.1341),
         (0.803612, 0.031257, -0.029833, 0.593582), (0.013655, 0.013549, 0.001274), (-2.9761, 2.9761), 3.485, 20.0),
    Link("right_l5", (0, 0.031, 0.275), (0.707107, -0.707107, 0, 0), 1.5625, (0.006113, -0.023697, 0.076416),
         (0.404076, 0.9135, 0.047313, 0.001583), (0.004741, 0.004229, 0.001907), (-2.9761, 2.9761), 3.485, 20.0, 0.2),
    Link("right_l6", (0, -0.11, 0.1053), (0.061625, 0.06163, -0.704416, 0.704416), 0.3292,
         (-8.0e-06, 0.008584, -0.004957), (0.479044, 0.515636, -0.513069, 0.491322), (0.00036, 0.000311, 0.000215),
         (-4.7124, 4.7124), 4.545, 10.0, 0.1),
)  # fmt: skip

JOINTS = tuple(f"right_j{i}" for i in range(NUM_JOINTS))
JOINT_SPEEDS = tuple(link.speed for link in LINKS)
"""Joint velocity limits, rad/s: what an arm action of 1 asks for at a velocity scale of 1."""


def add_sawyer(spec: mujoco.MjSpec) -> None:
    """Adds the arm, gripper, actuators and the hand's sensors to `spec`.

    Actuators are the seven joint velocity servos (rad/s) followed by the two finger position servos (m). The
    sites `grip_site` and `griptip_site` share the hand's frame: z is the approach direction, y the direction
    in which the fingers close.
    """
    body = spec.worldbody.add_body(name="base", pos=BASE_POS, quat=BASE_QUAT)
    for joint, link in zip(JOINTS, LINKS, strict=True):
        body = _add_link(spec, body, joint, link)
    _add_collision_geoms(spec)
    hand = body.add_body(name="hand", pos=(0, 0, 0.0495), quat=(0.707105, 0, 0, 0.707108), gravcomp=1)
    hand.mass, hand.inertia, hand.explicitinertial = 0.3, (3e-4, 3e-4, 1e-4), True
    hand.add_geom(
        type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=(0.029, 0.02, 0), pos=(0, 0, 0), contype=0, conaffinity=PART_BIT,
        mass=0, rgba=(0.25, 0.25, 0.28, 1),
    )  # fmt: skip
    hand.add_site(name="grip_site", pos=(0, 0, 0.065))
    hand.add_site(name="griptip_site", pos=(0, 0, 0.095))
    _add_finger(spec, hand, FINGERS[0], side=1)
    _add_finger(spec, hand, FINGERS[1], side=-1)
    _add_hand_sensors(spec)


def _add_link(spec: mujoco.MjSpec, parent, joint: str, link: Link):
    body = parent.add_body(name=link.name, pos=link.pos, quat=link.quat, gravcomp=1)
    body.mass, body.ipos, body.iquat, body.inertia = link.mass, link.com, link.inertia_quat, link.inertia
    body.explicitinertial = True
    body.add_joint(
        name=joint, type=mujoco.mjtJoint.mjJNT_HINGE, axis=(0, 0, 1), range=link.limit, limited=True,
        damping=link.damping, armature=ARMATURE,
    )  # fmt: skip
    servo = spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    servo.set_to_velocity(kv=link.gain)
    servo.ctrllimited, servo.ctrlrange = True, (-link.speed, link.speed)
    return body


def _add_collision_geoms(spec: mujoco.MjSpec) -> None:
    """Geometry of the links: all of it is drawn, only the sphere of the wrist collides, and with parts alone."""
    drawn = {"contype": 0, "conaffinity": 0, "group": 1, "mass": 0, "rgba": (0.55, 0.15, 0.15, 1)}
    cylinder, sphere = mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_SPHERE
    spec.body("base").add_geom(type=cylinder, size=(0.08, 0.12, 0), pos=(0, 0, 0.12), **drawn)
    spec.body("right_l0").add_geom(type=sphere, size=(0.07, 0, 0), pos=(0.08, 0, 0.23), **drawn)
    spec.body("right_l1").add_geom(type=sphere, size=(0.07, 0, 0), pos=(0, 0, 0.1225), **drawn)
    spec.body("right_l2").add_geom(type=cylinder, size=(0.06, 0.17, 0), pos=(0, 0, 0.08), **drawn)
    spec.body("right_l3").add_geom(type=sphere, size=(0.06, 0, 0), pos=(0, -0.01, -0.12), **drawn)
    spec.body("right_l4").add_geom(type=cylinder, size=(0.045, 0.15, 0), pos=(0, 0, 0.11), **drawn)
    meets_parts = {**drawn, "conaffinity": PART_BIT}
    spec.body("right_l5").add_geom(type=sphere, size=(0.06, 0, 0), pos=(0, 0, 0.1), **meets_parts)
    spec.body("right_l6").add_geom(type=cylinder, size=(0.055, 0.025, 0), pos=(0, 0.015, -0.01), **drawn)


def _add_finger(spec: mujoco.MjSpec, hand, name: str, side: int) -> None:
    """One finger: a slide along the hand's y, a thin link that never touches parts, a box pad that does."""
    opened, closed = (FINGER_OPEN[0], FINGER_CLOSED[0]) if side > 0 else (FINGER_OPEN[1], FINGER_CLOSED[1])
    low, high = sorted((opened, closed))
    finger = hand.add_body(name=name, pos=(0, side * 0.01, 0.02), gravcomp=1)
    finger.mass, finger.inertia, finger.explicitinertial = 0.03, (1e-4, 1e-4, 1e-4), True
    finger.add_joint(
        name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(0, 1, 0), range=(low, high), limited=True, damping=100.0,
        armature=0.3,
    )  # fmt: skip
    box = mujoco.mjtGeom.mjGEOM_BOX
    grey = (0.3, 0.3, 0.33, 1)
    finger.add_geom(
        type=box, size=(0.004, 0.004, 0.03), pos=(0, side * 0.0215, 0.035), contype=0, conaffinity=WORLD_BIT, mass=0,
        rgba=grey,
    )  # fmt: skip
    finger.add_geom(
        name=f"{name}_pad", type=box, size=(0.004, 0.004, 0.0185), pos=(0, side * 0.01275, 0.06),
        contype=PAD_BIT, conaffinity=PART_BIT, friction=(2.0, 0.05, 0.01), condim=4, mass=0, rgba=(0.1, 0.1, 0.1, 1),
    )  # fmt: skip
    servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    servo.set_to_position(kp=4000)
    servo.ctrllimited, servo.ctrlrange = True, (low, high)
    servo.forcelimited, servo.forcerange = True, (-20, 20)


def _add_hand_sensors(spec: mujoco.MjSpec) -> None:
    """Position, quaternion and velocities of the hand, in the world frame."""
    sensor, site = mujoco.mjtSensor, mujoco.mjtObj.mjOBJ_SITE
    for name, kind, place in (
        ("grip_pos", sensor.mjSENS_FRAMEPOS, "grip_site"),
        ("hand_quat", sensor.mjSENS_FRAMEQUAT, "grip_site"),
        ("grip_linvel", sensor.mjSENS_FRAMELINVEL, "grip_site"),
        ("grip_angvel", sensor.mjSENS_FRAMEANGVEL, "grip_site"),
        ("tip_pos", sensor.mjSENS_FRAMEPOS, "griptip_site"),
    ):
        spec.add_sensor(name=name, type=kind, objtype=site, objname=place)
