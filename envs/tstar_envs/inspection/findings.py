"""What is wrong or doubtful about a piece of furniture, in plain words, without simulating it.

*Wrong* is what cannot work: a part that starts inside another, a place that the arm does not reach, a grasp with
nothing between the fingers. *Doubtful* is what often goes wrong: a thin part, a start that noise can spoil.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from tstar_envs.furniture import library
from tstar_envs.furniture.consistency import joined_pieces
from tstar_envs.furniture.schema import Furniture
from tstar_envs.inspection.assembly_checks import assembly_findings
from tstar_envs.inspection.workshop import Workshop
from tstar_envs.settings import TaskSettings

LEAST_MASS = 0.0005
"""kg. Lighter parts shiver when they are touched."""
LARGE = 1.0
"""m: a part longer than that hardly finds room before the robot."""
FLOATS = 0.03
"""m: a connector further from its part's surface joins parts that do not touch."""
IN_FLOOR, ABOVE_FLOOR = 0.003, 0.03
"""m: how deep in the floor, and how high above it, a part may start."""


@dataclass(frozen=True)
class Finding:
    """One thing to look at: `where` in the file, and what about it; `wrong` where it cannot work as it is."""

    wrong: bool
    where: str
    text: str

    def __str__(self) -> str:
        return f"{'WRONG   ' if self.wrong else 'doubtful'}  {self.where}: {self.text}"


def inspect(furniture: Furniture, file: Path | None = None) -> list[Finding]:
    """Everything that is wrong or doubtful about a piece, wrong things first.

    Args:
        furniture: the piece.
        file: that it was read from, if the name of that is to be looked at: whether the library would find it.
    """
    workshop = Workshop(furniture)
    found = [Finding(*each) for check in _CHECKS for each in check(workshop)]
    found += [Finding(False, "the file's name", text) for text in _place(furniture.name, file)]
    return sorted(found, key=lambda finding: not finding.wrong)


def _place(name: str, file: Path | None) -> Iterator[str]:
    """What the library would make of a file in one of its folders."""
    if file is None:
        return
    if file.suffix != ".yaml":
        yield f"the library would not see {file.name}: its files end in .yaml"
    if others := [other for other in library.files(name) if other.resolve() != file.resolve()]:
        yield f"{others[0]} has it already: beside that one neither would be loaded"
    of_gymnasium = library.camel_case(name)
    if same := [one for one in library.names() if one != name and library.camel_case(one) == of_gymnasium]:
        yield f"{same[0]} has the same id in Gymnasium, {of_gymnasium}: one of them would get none"


def _name(workshop: Workshop) -> Iterator[tuple[bool, str, str]]:
    name = workshop.furniture.name
    if not library.is_name(name):
        yield (
            False,
            "the file's name",
            f"{name!r} is no name of a piece of the library, which would not see the file: take words of small "
            "letters and digits, joined by _",
        )


def _sizes(workshop: Workshop) -> Iterator[tuple[bool, str, str]]:
    for i, part in enumerate(workshop.furniture.parts):
        mass, where = workshop.mass(i), f"parts.{part.name}"
        if mass < LEAST_MASS:
            text = f"the part weighs {1000 * mass:.3g} g: below {1000 * LEAST_MASS:g} g it shivers when it is touched"
            yield False, f"{where}.density", text
        extent = max(shape.extent for shape in part.shapes)
        if extent > LARGE:
            yield False, where, f"it has a shape {extent:.2f} m long, the arm reaches about 0.9 m"
        for connector in part.connectors:
            off = workshop.off_surface(i, np.array(connector.pos))
            if off > FLOATS:
                yield (
                    off > 0.2,
                    f"{where}.connectors.{connector.name}.pos",
                    f"it floats {1000 * off:.0f} mm off the part's surface: the joined parts would not touch",
                )


def _unused(workshop: Workshop) -> Iterator[tuple[bool, str, str]]:
    pieces = joined_pieces(workshop.furniture)
    several = [piece for piece in pieces if len(piece) > 1]
    for (alone,) in (piece for piece in pieces if len(piece) == 1):
        yield False, f"parts.{alone}", "no step joins it to anything"
    if len(several) > 1:
        listed = "; ".join(", ".join(piece) for piece in several)
        yield False, "steps", f"they leave {len(several)} pieces that no step joins: {listed}"


def _starts(workshop: Workshop) -> Iterator[tuple[bool, str, str]]:
    """Where parts lie at the start: in the floor, in each other, under the hand."""
    workshop.place(workshop.nominal[0])
    names, noise = workshop.furniture.part_names, 2 * TaskSettings.part_noise
    free = {frozenset(pair) for pair in workshop.furniture.no_contact}
    for i, name in enumerate(names):
        lowest, where = workshop.lowest(i), f"parts.{name}.initial_pose"
        if lowest < -IN_FLOOR:
            yield True, where, f"it starts {-1000 * lowest:.0f} mm in the floor: raise z by as much"
        if lowest > ABOVE_FLOOR:
            yield False, where, f"it starts {1000 * lowest:.0f} mm above the floor, and falls"
        gap = workshop.gap_to_hand(i)
        if gap < TaskSettings.part_noise:
            yield gap < 0, where, f"it starts {1000 * gap:.0f} mm from the hand at home: move it away"
    for i, j in combinations(range(len(names)), 2):
        if frozenset((names[i], names[j])) in free:
            continue
        gap, where = workshop.gap(i, j), f"parts.{names[j]}.initial_pose"
        if gap < 0:
            yield True, where, f"it starts {-1000 * gap:.0f} mm inside {names[i]}"
        elif gap < noise:
            yield (
                False,
                where,
                f"{1000 * gap:.0f} mm from {names[i]}: start noise moves each of them by up to "
                f"{1000 * TaskSettings.part_noise:.0f} mm",
            )


_CHECKS = (_name, _sizes, _unused, _starts, assembly_findings)
