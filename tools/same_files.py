"""Which files of two folders differ: of tables everything but times, of skills all networks and sets, to the bit."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from torch import Tensor

from tstar_rl.chaining.skill import Skill
from tstar_rl.runs.checkpoint import is_checkpoint

TIMED = ["minutes"]
"""Columns of tables that are measured times."""


def differing(patterns: Sequence[str], whole: Path, folder: Path) -> list[str]:
    """The paths below `folder` that are missing or differ from those below `whole`, and patterns that find none."""
    found = {
        pattern: {path.relative_to(place) for place in (whole, folder) for path in place.glob(pattern)}
        for pattern in patterns
    }
    nothing = [f"{pattern} (nothing was written)" for pattern, paths in found.items() if not paths]
    wrong = {
        str(path) for paths in found.values() for path in paths if not _same(whole / path, folder / path)
    }
    return nothing + sorted(wrong)


def _same(first: Path, second: Path) -> bool:
    if not (first.exists() and second.exists()):
        return False
    if first.suffix == ".csv":
        read = [pd.read_csv(path, dtype=str, keep_default_na=False) for path in (first, second)]
        one, two = (table.drop(columns=TIMED, errors="ignore") for table in read)
        return one.equals(two)
    if first.suffix == ".npz":
        one, two = np.load(first), np.load(second)
        return one.files == two.files and all(np.array_equal(one[name], two[name]) for name in one.files)
    if first.is_file():
        return first.read_bytes() == second.read_bytes()
    if not is_checkpoint(first):  # of a chain: its skills are found by themselves
        one, two = ({path.name for path in place.iterdir()} for place in (first, second))
        return not is_checkpoint(second) and one == two
    return is_checkpoint(second) and _equal(*(Skill.load(path).state_dict() for path in (first, second)))


def _equal(one: Any, other: Any) -> bool:
    """Whether two states, dictionaries of dictionaries, have the same entries and the same bits."""
    if isinstance(one, Mapping):
        return one.keys() == other.keys() and all(_equal(value, other[key]) for key, value in one.items())
    return one.equal(other) if isinstance(one, Tensor) else one == other
