"""The values on a command line, and which of them another recipe is given."""

import re
from collections.abc import Container, Iterable, Mapping
from typing import Any

from hydra.core.hydra_config import HydraConfig

__all__ = ["chosen_scale", "known_to", "passed_on", "quoted", "section_of"]


def passed_on(own: Container[str]) -> list[str]:
    """The values on this recipe's command line that the recipes which it starts are given too.

    Args:
        own: keys and sections that only this recipe knows; values of these are left out, and launch, for the recipes
            that are started start none.
    """
    given = HydraConfig.get().overrides.task
    return [value for value in given if section_of(value) not in own and section_of(value) != "launch"]


def chosen_scale() -> str:
    """The scale that this recipe's command line has chosen, or its config's default."""
    return HydraConfig.get().runtime.choices["scale"]


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
    return re.split(r"[.=]", value.lstrip("+~"), maxsplit=1)[0]
