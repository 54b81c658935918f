"""What is said when a piece of furniture, or a name in its file, cannot be."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class FurnitureError(ValueError):
    """A piece of furniture is unknown, or its file says something that cannot be."""


def did_you_mean(got: str, valid: Iterable[str]) -> str:
    """Returns the tail of an error message: the nearest valid name, if one is near, and all of them."""
    valid = sorted(valid)
    near = difflib.get_close_matches(got, valid, n=1)
    return (f"did you mean {near[0]!r}? " if near else "") + f"valid: {', '.join(map(repr, valid)) or 'none'}"
