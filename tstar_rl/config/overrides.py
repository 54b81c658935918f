"""Values of a command line as text: what they are of, and how one is written."""

import re
from collections.abc import Iterable, Mapping
from typing import Any

__all__ = ["key_of", "known_to", "quoted", "section_of"]


def key_of(value: str) -> str:
    """What a value of the command line sets: `chain.rounds` of `+chain.rounds=2`."""
    return value.lstrip("+~").partition("=")[0]


def known_to(config: Mapping[str, Any], overrides: Iterable[str]) -> tuple[str, ...]:
    """Those of a training's overrides whose section, or value without one, another recipe's config has.

    Args:
        config: of the other recipe, as of an evaluation, which has no value of its own for every training's.
        overrides: as on the command line: `chain.rounds=2`, `+env.snap=true`, `sigma=0.1`.
    """
    return tuple(each for each in overrides if section_of(each) in config)


def quoted(value: str) -> str:
    """A text as the value of an override: in quotes where Hydra's grammar would read some of it otherwise."""
    if re.fullmatch(r"[\w/.+-]*", value, re.ASCII):
        return value
    return "'{}'".format(re.sub(r"(\\*)('|\Z)", lambda end: 2 * end[1] + end[2].replace("'", "\\'"), value))


def section_of(value: str) -> str:
    """The section that a value of the command line is of, or its key where it is of none."""
    return key_of(value).partition(".")[0]
