"""What the numbers, words and names of a piece may be; an error names the field as a furniture file does.

The functions return nothing, and raise a `FurnitureError` for what cannot be.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from numbers import Real
from typing import Any

from tstar_envs.checks import is_finite, short
from tstar_envs.furniture.errors import FurnitureError, did_you_mean

MAX_LENGTH = 2.0
"""m: nothing further away or larger can be reached, or is furniture."""
MIN_SIZE = 1e-4
"""m: the least half-size or radius."""
UNIT = 1e-3
"""How far from 1 the length of a unit vector or quaternion may be."""


def check_number(
    where: str, value: Any, positive: bool = False, least: float = -math.inf, most: float = math.inf
) -> None:
    """A finite number in its bounds."""
    if isinstance(value, bool) or not isinstance(value, Real) or not is_finite(value):
        raise FurnitureError(f"{where}: got {short(value)}, expected a finite number{_as_number(value)}")
    number = float(value)
    if positive and number <= 0:
        raise FurnitureError(f"{where}: got {number:g}, expected a positive number")
    if not least <= number <= most:
        valid = f"from {least:g} to {most:g}" if math.isfinite(least) else f"of at most {most:g}"
        raise FurnitureError(f"{where}: got {number:g}, expected a number {valid}")


def _as_number(value: Any) -> str:
    """What to write for a word that looks like a number: YAML takes 5e-2, which has no dot, for a word."""
    try:
        number = float(value) if isinstance(value, str) else math.nan
    except ValueError:
        return ""
    return f"; YAML reads that as a word, write {number}" if math.isfinite(number) else ""


def check_lengths(where: str, values: Sequence[float]) -> None:
    """Three lengths or coordinates in m, none of them further than `MAX_LENGTH`."""
    _check_numbers(where, values, 3)
    if max(map(abs, values)) > MAX_LENGTH:
        got = short(list(values))
        raise FurnitureError(f"{where}: got {got}, expected lengths in m, none beyond {MAX_LENGTH:g}")


def check_sizes(where: str, values: Sequence[float], count: int = 1) -> None:
    """`count` half-sizes, or a radius, in m, between `MIN_SIZE` and half of `MAX_LENGTH`."""
    most = MAX_LENGTH / 2
    _check_numbers(where, values, count)
    if min(values) < MIN_SIZE or max(values) > most:
        got = list(values) if len(values) > 1 else values[0]
        raise FurnitureError(f"{where}: got {got}, expected half-sizes in m from {MIN_SIZE:g} to {most:g}")


def check_unit(where: str, values: Sequence[float], size: int = 3) -> None:
    """A unit vector (x, y, z), or with a size of 4 a unit quaternion (w, x, y, z)."""
    _check_numbers(where, values, size)
    if abs((length := math.hypot(*values)) - 1) > UNIT:
        raise FurnitureError(f"{where}: got {list(values)} of length {length:.3f}, expected length 1")


def _check_numbers(where: str, values: Sequence[float], size: int) -> None:
    if not isinstance(values, (tuple, list)) or len(values) != size:
        raise FurnitureError(f"{where}: got {short(values)}, expected {size} numbers")
    for value in values:
        check_number(where, value)


def check_choice(where: str, value: Any, valid: tuple[str, ...]) -> None:
    """One of the words of `valid`."""
    if value not in valid:
        raise FurnitureError(f"{where}: got {short(value)}, {did_you_mean(str(value), valid)}")


def check_names(where: str, names: Iterable[Any]) -> None:
    """Names, each once."""
    seen = set()
    for name in names:
        if not isinstance(name, str) or not name:
            raise FurnitureError(f"{where}: got {short(name)}, expected a name")
        if name in seen:
            raise FurnitureError(f"{where}: two are called {name!r}, expected each name once")
        seen.add(name)
