"""What a user's mistake is, the name that was meant, and what the numbers in the settings of an update may be."""

import difflib
import math
import numbers
from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from importlib.util import find_spec
from typing import Any

__all__ = [
    "DivergedError",
    "InvalidValueError",
    "MissingExtraError",
    "MissingFileError",
    "NothingToDo",
    "UserError",
    "check_choices",
    "check_losses",
    "check_ranges",
    "check_sizes",
    "did_you_mean",
    "import_extra",
    "need_extra",
]


class UserError(Exception):
    """A mistake that the user can put right: the message says what was got, what is valid and where it belongs.

    A recipe ends with this message alone; any other error shows where it was raised. Errors of this kind are also of a
    kind of Python's own, so that users of the library catch them as usual: `class ConfigError(UserError, ValueError)`.
    """


class InvalidValueError(UserError, ValueError):
    """A value that a user gave is not valid; the message says which are."""


class NothingToDo(UserError):
    """What is asked for is there already. A recipe ends with this message as one that has done its work."""


class DivergedError(UserError, ArithmeticError):
    """A training has a loss that is no finite number: what it would go on to is of no use."""


class MissingFileError(UserError, FileNotFoundError):
    """A file that a recipe reads is not there; the message says what writes it."""


class MissingExtraError(UserError, ImportError):
    """An optional dependency is not installed; the message says how to install it."""


def did_you_mean(got: object, valid: Iterable[str], cutoff: float = 0.6) -> str:
    """The tail of a message on an unknown name: "; did you mean <the nearest valid one>?", or nothing if none is near.

    Args:
        got: what was given.
        valid: names.
        cutoff: of difflib's ratio of two names, in [0, 1].
    """
    near = difflib.get_close_matches(str(got), list(valid), n=1, cutoff=cutoff)
    return f"; did you mean {near[0]}?" if near else ""


def import_extra(module: str, extra: str, why: str) -> Any:
    """Imports a library that is not installed with this package unless an extra asks for it.

    Args:
        module: its name.
        extra: of `pyproject.toml`.
        why: what needs it.

    Raises:
        MissingExtraError: if it is not there, or is there and does not work.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if error.name not in (module, module.partition(".")[0]):
            raise MissingExtraError(
                f"{why} needs {module}, which is installed, but not {error.name}"
            ) from error
        raise _missing(module, extra, why) from error
    except ImportError as error:
        raise MissingExtraError(f"{why} needs {module}, which is installed, and fails: {error}") from error


def need_extra(module: str, extra: str, why: str) -> None:
    """As `import_extra`, before the library is needed: it is looked for, and not imported."""
    if find_spec(module) is None:
        raise _missing(module, extra, why)


def _missing(module: str, extra: str, why: str) -> MissingExtraError:
    return MissingExtraError(
        f"{why} needs {module}, which is not installed: python -m pip install -e '.[{extra}]' in a clone, "
        f"or 'tstar_rl[{extra}]'"
    )


RANGES = {
    "count": ("at least 1", lambda value: value >= 1),
    "count_from_0": ("not negative", lambda value: value >= 0),
    "positive": ("positive", lambda value: 0 < value < math.inf),
    "not_negative": ("not negative", lambda value: 0 <= value < math.inf),
    "share": ("in [0, 1]", lambda value: 0 <= value <= 1),
    "positive_share": ("in (0, 1]", lambda value: 0 < value <= 1),
    "finite": ("a finite number", math.isfinite),
    "limit": ("positive (.inf: no limit)", lambda value: value > 0),
}
"""Of each kind of number, what a message calls it and whether a value is one. NaN is none."""


def check_ranges(settings: Any, **kinds: Sequence[str]) -> None:
    """Checks the numbers in a settings object; one that is None is left out.

    Args:
        settings: a dataclass.
        **kinds: for a kind of `RANGES`, the names of the fields that are of it.

    Raises:
        InvalidValueError: for the first that is not what it has to be.
    """
    for kind, names in kinds.items():
        said, fits = RANGES[kind]
        number, called = (
            (numbers.Integral, "a whole number") if kind.startswith("count") else (numbers.Real, "a number")
        )
        for name in names:
            value = getattr(settings, name)
            if value is None:
                continue
            if isinstance(value, bool) or not isinstance(value, number):
                raise InvalidValueError(f"{type(settings).__name__}.{name} must be {called}, got {value!r}")
            if not fits(value):
                raise InvalidValueError(f"{type(settings).__name__}.{name} must be {said}, got {value}")


def check_losses(values: Mapping[str, Any], after: str) -> None:
    """Checks that every loss among logged values is a finite number.

    Args:
        values: by name; a loss has the word "loss" in its name, as loss_policy and bc_loss do.
        after: says when it was, as in "after 4096 steps".

    Raises:
        DivergedError: for the first that is not.
    """
    for name, value in values.items():
        if "loss" in name.split("_") and value is not None and not math.isfinite(value):
            raise DivergedError(
                f"the training has diverged: {name} is {float(value)} {after}. Begin anew (resume=false) with lower "
                "learning rates, or look at what it learns from: a reward or an observation may be no finite number"
            )


def check_choices(settings: Any, **choices: Iterable[str]) -> None:
    """Checks fields of a settings object that are one of a few words.

    Args:
        settings: a dataclass.
        **choices: the valid words of each field.

    Raises:
        InvalidValueError: for the first that is another.
    """
    for name, valid in choices.items():
        if (got := getattr(settings, name)) not in valid:
            raise InvalidValueError(
                f"{type(settings).__name__}.{name} must be one of {', '.join(valid)}; got {got!r}"
            )


def check_sizes(settings: Any, *names: str) -> None:
    """Checks the sizes of hidden layers in a settings object; no layer at all is one way to be, None another.

    Args:
        settings: a dataclass.
        *names: of the fields.

    Raises:
        InvalidValueError: for the first that has a layer of less than one unit.
    """
    for name in names:
        if min((sizes := getattr(settings, name)) or (), default=1) < 1:
            raise InvalidValueError(
                f"{type(settings).__name__}.{name} must be sizes of at least 1, got {sizes}"
            )
