"""Checks of plain numbers that a caller gives; what is said names the argument, what was got and what is valid."""

from __future__ import annotations

import math
import numbers
import reprlib
from typing import Any


def is_finite(value: float) -> bool:
    """Whether a number is finite and a float can hold it."""
    try:
        return math.isfinite(value)
    except OverflowError:
        return False


_PART = reprlib.Repr()
_PART.maxlevel, _PART.maxstring, _PART.maxother, _PART.maxlong = 3, 60, 60, 60
_PART.maxlist = _PART.maxtuple = _PART.maxdict = _PART.maxset = 8


def short(value: Any) -> str:
    """What a message shows of a value: of a list of lists no more than is shown, though it be endless."""
    try:
        text = _PART.repr(value)
    except ValueError:  # a whole number of more digits than Python prints
        return "a very long number"
    return text if len(text) <= 60 else text[:57] + "..."


def whole_number(name: str, value: Any, least: int, most: int | None = None) -> int:
    """Returns `value` as an int.

    Raises:
        ValueError: it is no whole number (True and 2.0 are none), below `least` or above `most`.
    """
    number = isinstance(value, (int, numbers.Integral)) and not isinstance(value, bool)
    if not number or int(value) < least or (most is not None and int(value) > most):
        end = "" if most is None else f" to {most}"
        raise ValueError(f"{name} must be a whole number from {least}{end}, got {short(value)}")
    return int(value)


def subtask_number(furniture: str, value: Any, steps: int) -> int | None:
    """Returns the number of a subtask, 0-based, as an int; None, the whole task, as it is.

    Raises:
        ValueError: it is no number of one of the furniture's `steps`.
    """
    number = isinstance(value, numbers.Integral) and not isinstance(value, bool)
    if value is not None and not (number and 0 <= int(value) < steps):
        raise ValueError(
            f"subtask of {furniture} must be None (the whole task) or in 0..{steps - 1}, got {short(value)}"
        )
    return None if value is None else int(value)


def finite_number(name: str, value: Any) -> float:
    """Returns `value` as a float.

    Raises:
        ValueError: it is no number, NaN or infinite.
    """
    if isinstance(value, bool) or not isinstance(value, numbers.Real) or not is_finite(value):
        raise ValueError(f"{name} must be a finite number, got {short(value)}")
    return float(value)
