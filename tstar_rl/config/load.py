"""From the values in `configs/` to a checked config: where every recipe begins."""

import difflib
import functools
import logging
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import torch
from omegaconf import DictConfig, OmegaConf

from tstar_rl.config.check import ConfigError, check
from tstar_rl.config.command_line import command_line
from tstar_rl.config.ranges import check_machine, check_ranges_of
from tstar_rl.config.schema import Config

__all__ = ["check_config", "plain", "recipe", "settings", "task_section"]

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
OWN_KEYS: dict[str, dict[str, Any]] = {}
"""Of each recipe that was imported, the keys that no other recipe needs to have, and the types of their values."""


def recipe(name: str, **own: Any) -> Callable[[Callable[[DictConfig], None]], Callable[..., None]]:
    """Makes a function of the config into the main function of a recipe: one torch thread, values from `configs/`.

    A user's mistake ends it with a message: see `command_line`.

    Args:
        name: of its file in `configs/recipe`.
        **own: keys of that file which `config_schema.Config` does not have, and the types of their values.
    """
    OWN_KEYS[name] = own

    def decorate(function: Callable[[DictConfig], None]) -> Callable[..., None]:
        @functools.wraps(function)
        def body(config: DictConfig) -> None:
            check_config(config, name)
            check_machine(plain(config))
            torch.set_num_threads(config.torch_threads)
            logging.getLogger("torchrl").setLevel(logging.WARNING)
            function(config)

        return command_line(body, CONFIGS, name, partial(check_config, name=name))

    return decorate


def plain(config: DictConfig) -> dict[str, Any]:
    """The config as nested plain values."""
    return OmegaConf.to_container(config, resolve=True, throw_on_missing=True)  # type: ignore[return-value]


def task_section(name: str) -> DictConfig:
    """The values of configs/task/<name>.yaml.

    Raises:
        ConfigError: if there is no such file; it lists those that there are.
    """
    files = {path.stem: path for path in sorted((CONFIGS / "task").glob("*.yaml"))}
    if name not in files:
        near = difflib.get_close_matches(name, files, n=1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise ConfigError(
            f"a task must be one of {', '.join(files)} (files of configs/task), got {name!r}{hint}"
        )
    return OmegaConf.load(files[name])  # pyright: ignore[reportReturnType]


def check_config(config: DictConfig, name: str) -> None:
    """Checks all names, types and ranges in the config of the recipe `name`.

    Raises:
        ConfigError: see `check.check` and `ranges.check_ranges_of`; also for an unknown task, a wrong number of
            subtasks, and unknown settings of the task or values of them.
    """
    from tstar_rl.env.furniture_env import check_task

    values = plain(config)
    check(values, Config, "", OWN_KEYS[name])
    try:
        check_task(config.task.name, config.task.subtasks, values["env"])
    except ValueError as error:  # the world's own; it knows no configs
        raise ConfigError(str(error)) from error
    check_ranges_of(values)


Settings = TypeVar("Settings")


def settings(kind: type[Settings], section: Mapping[str, Any] | DictConfig) -> Settings:
    """A frozen settings object from a section of the config.

    Raises:
        ConfigError: for a name that `kind` does not have, or a value of another type.
    """
    values = (
        OmegaConf.to_container(section, resolve=True) if isinstance(section, DictConfig) else dict(section)
    )
    assert isinstance(values, dict)
    check({str(name): value for name, value in values.items()}, kind, kind.__name__)
    return kind(**{str(k): tuple(v) if isinstance(v, list) else v for k, v in values.items()})
