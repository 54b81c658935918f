"""From the values in `configs/` to a checked config: where every recipe begins.

Names, plain values and what Hydra refuses are checked before torch is imported: such a mistake, and `--help`, take a
second and not five.
"""

import difflib
import functools
import gc
import logging
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar

from omegaconf import DictConfig, OmegaConf

from tstar_rl.config.check import ConfigError, check
from tstar_rl.config.command_line import command_line, told_in_words
from tstar_rl.config.ranges import check_machine, check_ranges_of, find
from tstar_rl.config.schema import SECTIONS, Config

__all__ = ["check_config", "plain", "recipe", "settings", "task_section"]

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
OWN_KEYS: dict[str, dict[str, Any]] = {}
"""Of each recipe that was imported, the keys that no other recipe needs to have, and the types of their values."""


def recipe(name: str, **own: Any) -> Callable[[Callable[[DictConfig], None]], Callable[..., None]]:
    """Makes a function of the config into the main function of a recipe: one torch thread, values from `configs/`.

    A user's mistake ends it with a message: see `command_line`.

    Args:
        name: of its file in `configs/recipe`.
        **own: keys of that file which `schema.Config` does not have, and the types of their values.
    """
    OWN_KEYS[name] = own

    def decorate(function: Callable[[DictConfig], None]) -> Callable[..., None]:
        with told_in_words():
            check_checkout(Path(function.__code__.co_filename))

        @functools.wraps(function)
        def body(config: DictConfig) -> None:
            check_config(config, name)
            check_machine(plain(config))
            import torch

            torch.set_num_threads(config.torch_threads)
            logging.getLogger("torchrl").setLevel(logging.WARNING)
            function(config)

        return command_line(body, CONFIGS, name, partial(check_config, name=name))

    return decorate


def check_checkout(recipe: Path) -> None:
    """Checks that a recipe which lies in a checkout of the library runs with the code and the configs of that checkout.

    In a worktree of git with the environment of the first checkout, Python finds the first one's code.

    Raises:
        ConfigError: if it does not; it says what to do.
    """
    here, there = CONFIGS.parent, recipe.resolve().parents[1]
    if there != here and (there / "tstar_rl").is_dir():
        raise ConfigError(
            f"{recipe} would run with the code of {here}: install {there} in an environment of its own, "
            f"or set PYTHONPATH={there}:{there / 'envs'}"
        )


@contextmanager
def imports_not_collected() -> Iterator[None]:
    """Spares garbage collection what is imported meanwhile: a million objects of TorchRL's modules, which all stay.

    Python would look through them again and again, for a fifth of the time that they take to import.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


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
    values = plain(config)
    check(values, Config, "", OWN_KEYS[name])
    check_ranges_of(values)
    if "torchrl" not in sys.modules:
        with imports_not_collected():
            import_module("tstar_rl.config.chain")  # and with it all that training needs
    _check_what_the_library_declares(values)


def _check_what_the_library_declares(values: dict[str, Any]) -> None:
    """The part of `check_config` that needs TorchRL."""
    from torch import nn

    from tstar_rl.env.task_tables import check_task
    from tstar_rl.rollouts.starts import check_shares
    from tstar_rl.transforms import RewardMixture, TerminalStateReward

    for name, declared in SECTIONS.items():
        if (section := find(values, name)) is not None:
            room, _, kind = declared.rpartition(".")
            check(section, getattr(import_module(f"tstar_rl.{room}"), kind), name)
    try:
        check_task(values["task"]["name"], values["task"]["subtasks"], values["env"])
    except ValueError as error:  # the world's own; it knows no configs
        raise ConfigError(str(error)) from error
    if shares := find(values, "chain.starts"):
        check_shares(shares)
    RewardMixture(**values["reward"])  # both say what is wrong with their section
    TerminalStateReward(nn.Identity(), **values["terminal_reward"])


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
