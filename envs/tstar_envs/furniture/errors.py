"""What is said when a piece of furniture, or a name in its file, cannot be."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class FurnitureError(ValueError):
    """A piece of furniture is unknown, or its file says something that cannot be."""


def nearest(got: str, names: Iterable[str]) -> str | None:
    """The name that is most like what was got, if one is near."""
    return next(iter(difflib.get_close_matches(str(got), list(names), n=1)), None)


def did_you_mean(got: str, valid: Iterable[str]) -> str:
    """Returns the tail of an error message: the nearest valid name, if one is near, and all of them."""
    valid = sorted(valid)
    near = nearest(got, valid)
    return (f"did you mean {near!r}? " if near else "") + f"valid: {', '.join(map(repr, valid)) or 'none'}"
