"""What is wrong or doubtful about a piece of furniture, in plain words, without simulating it.

*Wrong* is what cannot work: a part that starts inside another, a place that the arm does not reach, a grasp with
nothing between the fingers. *Doubtful* is what often goes wrong: a thin part, a start that noise can spoil.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from tstar_envs.furniture import library
from tstar_envs.furniture.schema import Furniture
from tstar_envs.inspection.assembly_checks import assembly_findings
from tstar_envs.inspection.finding import Finding, doubtful
from tstar_envs.inspection.part_checks import part_findings
from tstar_envs.inspection.workshop import Workshop


def inspect(furniture: Furniture, file: Path | None = None) -> list[Finding]:
    """Everything that is wrong or doubtful about a piece, wrong things first.

    Args:
        furniture: the piece.
        file: that it was read from, if the name of that is to be looked at: whether the library would find it.
    """
    workshop = Workshop(furniture)
    found = [*part_findings(workshop), *assembly_findings(workshop)]
    found += [doubtful("the file's name", text) for text in _place(furniture.name, file)]
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
