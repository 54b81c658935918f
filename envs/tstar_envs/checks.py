"""Checks of plain numbers that a caller gives; what is said names the argument, what was got and what is valid."""

from __future__ import annotations

import math
import numbers
from typing import Any


def whole_number(name: str, value: Any, least: int, most: int | None = None) -> int:
    """Returns `value` as an int.

    Raises:
        ValueError: it is no whole number (True and 2.0 are none), below `least` or above `most`.
    """
    number = isinstance(value, (int, numbers.Integral)) and not isinstance(value, bool)
    if not number or int(value) < least or (most is not None and int(value) > most):
        end = "" if most is None else f" to {most}"
        raise ValueError(f"{name} must be a whole number from {least}{end}, got {value!r}")
    return int(value)


def finite_number(name: str, value: Any) -> float:
    """Returns `value` as a float.

    Raises:
        ValueError: it is no number, NaN or infinite.
    """
    if isinstance(value, bool) or not isinstance(value, numbers.Real) or not math.isfinite(value):
        raise ValueError(f"{name} must be a finite number, got {value!r}")
    return float(value)
