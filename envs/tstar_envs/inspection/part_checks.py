"""Checks of a piece's name, its parts, and how they lie at the start."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np

from tstar_envs.furniture import library
from tstar_envs.furniture.consistency import joined_pieces
from tstar_envs.inspection.finding import Finding, doubtful, wrong
from tstar_envs.inspection.workshop import Workshop
from tstar_envs.settings import TaskSettings

__all__ = ["part_findings"]

LEAST_MASS = 0.0005
"""kg. Lighter parts shiver when they are touched."""
LARGE = 1.0
"""m: a part longer than that hardly finds room before the robot."""
FLOATS = 0.03
"""m: a connector further from its part's surface joins parts that do not touch."""
IN_FLOOR, ABOVE_FLOOR = 0.003, 0.03
"""m: how deep in the floor, and how high above it, a part may start."""


def part_findings(workshop: Workshop) -> Iterator[Finding]:
    """Everything about the parts and where they start."""
    yield from _name(workshop)
    yield from _sizes(workshop)
    yield from _unused(workshop)
    yield from _starts(workshop)


def _name(workshop: Workshop) -> Iterator[Finding]:
    name = workshop.furniture.name
    if not library.is_name(name):
        yield doubtful(
            "the file's name",
            f"{name!r} is no name of a piece of the library, which would not see the file: take words of small "
            "letters and digits, joined by _",
        )


def _sizes(workshop: Workshop) -> Iterator[Finding]:
    for i, part in enumerate(workshop.furniture.parts):
        mass, where = workshop.mass(i), f"parts.{part.name}"
        if mass < LEAST_MASS:
            text = f"the part weighs {1000 * mass:.3g} g: below {1000 * LEAST_MASS:g} g it shivers when it is touched"
            yield doubtful(f"{where}.density", text)
        extent = max(shape.extent for shape in part.shapes)
        if extent > LARGE:
            yield doubtful(where, f"it has a shape {extent:.2f} m long, the arm reaches about 0.9 m")
        for connector in part.connectors:
            off = workshop.off_surface(i, np.array(connector.pos))
            if off > FLOATS:
                yield Finding(
                    off > 0.2,
                    f"{where}.connectors.{connector.name}.pos",
                    f"it floats {1000 * off:.0f} mm off the part's surface: the joined parts would not touch",
                )


def _unused(workshop: Workshop) -> Iterator[Finding]:
    pieces = joined_pieces(workshop.furniture)
    several = [piece for piece in pieces if len(piece) > 1]
    for (alone,) in (piece for piece in pieces if len(piece) == 1):
        yield doubtful(f"parts.{alone}", "no step joins it to anything")
    if len(several) > 1:
        listed = "; ".join(", ".join(piece) for piece in several)
        yield doubtful("steps", f"they leave {len(several)} pieces that no step joins: {listed}")


def _starts(workshop: Workshop) -> Iterator[Finding]:
    """Where parts lie at the start: in the floor, in each other, under the hand."""
    workshop.place(workshop.nominal[0])
    names, noise = workshop.furniture.part_names, 2 * TaskSettings.part_noise
    free = {frozenset(pair) for pair in workshop.furniture.no_contact}
    for i, name in enumerate(names):
        lowest, where = workshop.lowest(i), f"parts.{name}.initial_pose"
        if lowest < -IN_FLOOR:
            yield wrong(where, f"it starts {-1000 * lowest:.0f} mm in the floor: raise z by as much")
        if lowest > ABOVE_FLOOR:
            yield doubtful(where, f"it starts {1000 * lowest:.0f} mm above the floor, and falls")
        gap = workshop.gap_to_hand(i)
        if gap < TaskSettings.part_noise:
            yield Finding(
                gap < 0, where, f"it starts {1000 * gap:.0f} mm from the hand at home: move it away"
            )
    for i, j in combinations(range(len(names)), 2):
        if frozenset((names[i], names[j])) in free:
            continue
        gap, where = workshop.gap(i, j), f"parts.{names[j]}.initial_pose"
        if gap < 0:
            yield wrong(where, f"it starts {-1000 * gap:.0f} mm inside {names[i]}")
        elif gap < noise:
            yield doubtful(
                where,
                f"{1000 * gap:.0f} mm from {names[i]}: start noise moves each of them by up to "
                f"{1000 * TaskSettings.part_noise:.0f} mm",
            )
