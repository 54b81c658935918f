"""A compiled scene as Warp simulates it: what differs from the processor's MuJoCo, and how much room it is given.

Source: docs/decisions/0011-gpu-simulator.md.
"""

from __future__ import annotations

import copy
from typing import NamedTuple

import mujoco
import numpy as np

ON_FLOOR = 4
"""Contacts of a box that lies on the floor."""
BOX_TO_BOX = 8
"""Contacts that two boxes can make."""
ROWS_PER_CONTACT = 4
"""Constraint rows of a contact with condim 4, the pads'; other contacts have 3."""
ROWS_PER_WELD = 6


class Room(NamedTuple):
    """Sizes that Warp allocates once, per simulation."""

    contacts: int
    rows: int


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
    """How many contacts and constraint rows a simulation of `model` is given.

    Every box lies on the floor, and as many pairs of boxes touch in full as there are welds and fingers' pads: twice
    each, since the parts of a weld and a part between the pads touch more than one box.
    """
    boxes = int((model.geom_type == mujoco.mjtGeom.mjGEOM_BOX).sum())
    pads = int((model.geom_condim == ROWS_PER_CONTACT).sum())
    contacts = ON_FLOOR * boxes + 2 * BOX_TO_BOX * (model.neq + pads)
    limits = int(np.asarray(model.jnt_limited, dtype=bool).sum())
    return Room(contacts, ROWS_PER_CONTACT * contacts + ROWS_PER_WELD * model.neq + limits)
