"""Overrides of a training, and those of them that another step has a value for."""

from collections.abc import Iterable, Mapping
from typing import Any

__all__ = ["known_to"]


def known_to(config: Mapping[str, Any], overrides: Iterable[str]) -> tuple[str, ...]:
    """Those of a training's overrides whose section, or value without one, another recipe's config has.

    Args:
        config: of the other recipe, as of an evaluation, which has no value of its own for every training's.
        overrides: as on the command line: `chain.rounds=2`, `+env.snap=true`, `sigma=0.1`.
    """
    return tuple(
        each for each in overrides if each.lstrip("+~").partition("=")[0].partition(".")[0] in config
    )
