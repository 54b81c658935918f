"""A compiled scene as Warp simulates it: what differs from the processor's MuJoCo, and how much room it is given.

Source: docs/decisions/0011-gpu-simulator.md.
"""

from __future__ import annotations

import copy
from typing import NamedTuple

import mujoco
import numpy as np

ON_FLOOR = 4
"""Contacts of a box or a cylinder that lies on the floor; a capsule has two."""
BOX_TO_BOX = 8
"""Contacts that two boxes can make."""
ROWS_PER_CONTACT = 4
"""Constraint rows of a contact with condim 4, the pads'; other contacts have 3."""
ROWS_PER_WELD = 6


class Room(NamedTuple):
    """Sizes that Warp allocates once, per simulation."""

    contacts: int
    rows: int
    convex: int
    """Pairs that go to the convex collider, which takes some kilobytes for each."""


def warp_model(model: mujoco.MjModel) -> mujoco.MjModel:
    """A copy of `model` with the options that Warp needs.

    Without sleep a restored state has the same future, and masked kernels would not save what a GPU does anyway.
    With the native convex collider off, two boxes meet in the same routine as in MuJoCo, with the same contacts.
    """
    model = copy.copy(model)
    model.opt.enableflags &= ~mujoco.mjtEnableBit.mjENBL_SLEEP.value
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_NATIVECCD.value
    return model


def room(model: mujoco.MjModel) -> Room:
    """How many contacts, constraint rows and convex pairs a simulation of `model` is given.

    Every box and whatever else meets the floor lies on it, and as many pairs of boxes touch in full as there are welds
    and fingers' pads. That is about three times what the scripted assembler needs. Every row costs a GPU threads in
    every kernel of the solver.

    A cylinder meets boxes, cylinders and capsules in the convex collider. A pair takes its place there once it touches,
    so no more of them are counted than there are contacts, and Warp takes no more.
    """
    kind, shape = model.geom_type, mujoco.mjtGeom
    box, cylinder = kind == shape.mjGEOM_BOX, kind == shape.mjGEOM_CYLINDER
    meets = (model.geom_contype[:, None] & model.geom_conaffinity) != 0
    meets = (meets | meets.T) & (model.geom_bodyid[:, None] != model.geom_bodyid)
    lying = int((box | meets[kind == shape.mjGEOM_PLANE].any(0)).sum())
    pads = int((model.geom_condim == ROWS_PER_CONTACT).sum())
    contacts = ON_FLOOR * lying + BOX_TO_BOX * (model.neq + pads)
    limits = int(np.asarray(model.jnt_limited, dtype=bool).sum())
    rows = ROWS_PER_CONTACT * contacts + ROWS_PER_WELD * model.neq + limits
    convex = cylinder[:, None] & (box | cylinder | (kind == shape.mjGEOM_CAPSULE))
    pairs = int(np.triu(meets & (convex | convex.T)).sum())
    return Room(contacts, rows, min(pairs, contacts))
