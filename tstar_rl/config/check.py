"""Holds plain values against the names and types that a class declares."""

import inspect
from collections.abc import Mapping
from dataclasses import is_dataclass
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from tstar_rl.checks import InvalidValueError, did_you_mean

__all__ = ["ConfigError", "check"]


class ConfigError(InvalidValueError):
    """A config has a key that nobody reads, lacks one, or has a value that is not valid; the message names it."""


def check(values: Mapping[str, Any], kind: type, where: str, own: dict[str, Any] | None = None) -> None:
    """Checks a section's names and types, and those of the sections in it.

    Args:
        values: plain.
        kind: a dataclass, or a class whose constructor's defaults are the section.
        where: the section's name in messages; empty for the whole config.
        own: more names, and the type of each.

    Raises:
        ConfigError: for a name that `kind` does not have, one that is missing (unless it may be null or has a
            default), or a value of another type or out of its range.
    """
    parameters = inspect.signature(kind.__init__).parameters
    hints = {name: hint for name, hint in get_type_hints(kind.__init__).items() if name in parameters}
    given = {name for name in hints if parameters[name].default is not inspect.Parameter.empty}
    types = {name: hint for name, hint in hints.items() if is_dataclass(kind) or name in given} | (own or {})
    for name in values:
        if name not in types:
            hint = did_you_mean(name, types)
            raise ConfigError(f"{where or 'the config'} has no {name}; it has {', '.join(types)}{hint}")
    for name, wanted in types.items():
        if name in values:
            _check_value(values[name], wanted, f"{where}.{name}" if where else name)
        elif name not in given and not _fits(None, wanted):
            raise ConfigError(f"{where or 'the config'} lacks {name}, which must be {_say(wanted)}")
    if is_dataclass(kind) and hasattr(kind, "__post_init__"):
        _check_ranges(values, kind, where)


def _check_ranges(values: Mapping[str, Any], kind: type, where: str) -> None:
    """Makes the object, which checks what its numbers may be, and says of an error where it belongs."""
    try:
        kind(**{name: tuple(value) if isinstance(value, list) else value for name, value in values.items()})
    except ValueError as error:
        raise ConfigError(str(error).replace(f"{kind.__name__}.", f"{where}.")) from error


def _check_value(value: Any, wanted: Any, where: str) -> None:
    sections = [option for option in _options(wanted) if _is_section(option)]
    if sections and isinstance(value, Mapping):
        check(value, sections[0], where)
    elif not _fits(value, wanted):
        raise ConfigError(f"{where} must be {_say(wanted)}, got {value!r}")


def _options(kind: Any) -> tuple[Any, ...]:
    return get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,)


def _is_section(kind: Any) -> bool:
    return isinstance(kind, type) and kind not in _NAMES and get_origin(kind) is None


def _fits(value: Any, kind: Any) -> bool:
    origin, of = get_origin(kind), get_args(kind)
    if len(_options(kind)) > 1:
        return any(_fits(value, option) for option in _options(kind))
    if kind is Any:
        return True
    if origin is Literal:
        return value in of
    if origin is tuple:
        right = isinstance(value, (list, tuple)) and (of[-1] is ... or len(value) == len(of))
        return right and all(_fits(item, of[0]) for item in value)
    if origin is dict:
        return isinstance(value, Mapping) and all(_fits(item, of[1]) for item in value.values())
    if kind in (int, float):
        number = isinstance(value, int) or (kind is float and isinstance(value, float))
        return number and not isinstance(value, bool)
    return kind in _NAMES and isinstance(value, kind)


_NAMES = {int: "a whole number", float: "a number", bool: "true or false", str: "text", NoneType: "null"}


def _say(kind: Any) -> str:
    origin, of = get_origin(kind), get_args(kind)
    if len(_options(kind)) > 1:
        return " or ".join(_say(option) for option in _options(kind))
    if origin is Literal:
        return " or ".join(map(str, of))
    if origin is tuple:
        number = "" if of[-1] is ... else f" of {len(of)}"
        return f"a list{number}, each {_say(of[0])}"
    if origin is dict:
        return "a section" if of[1] is Any else f"a section, each value {_say(of[1])}"
    return "a section" if _is_section(kind) else _NAMES.get(kind, "anything")
