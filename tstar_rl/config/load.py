"""From the values in `configs/` to a checked config: where every recipe begins.

Names, plain values and what Hydra refuses are checked before torch is imported: such a mistake, and `--help`, take a
second and not five.
"""

import functools
import gc
import logging
import runpy
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, open_dict

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.check import ConfigError, check
from tstar_rl.config.command_line import command_line, told_in_words
from tstar_rl.config.ranges import check_machine, check_ranges_of, find
from tstar_rl.config.recipe_kinds import OURS
from tstar_rl.config.schema import SECTIONS, Config, Section
from tstar_rl.config.unread import check_what_is_not_read
from tstar_rl.config.values import CONFIGS, plain
from tstar_rl.runs.mismatch import FURNITURE
from tstar_rl.runs.run_folder import RECIPES

__all__ = ["check_config", "recipe"]

SAID_BY_THE_NEXT = ("reward_tsr", "reward_proximity")
"""The library's rewards that a skill gets from the next one alone."""
NOTED = ("recipe", FURNITURE, "script", "versions", "later")
"""Keys of a run's config.yaml that are no values."""
OWN_KEYS: dict[str, dict[str, Any]] = {}
"""Of each recipe that was imported, the keys that no other recipe needs to have, and the types of their values."""


def recipe(name: str, **own: Any) -> Callable[[Callable[[DictConfig], None]], Callable[..., None]]:
    """Makes a function of the config into the main function of a recipe: one torch thread, values from `configs/`.

    A user's mistake ends it with a message: see `command_line`.

    Args:
        name: of its file in `configs/recipe`.
        **own: keys of that file which `schema.Config` does not have, and the types of their values.

    Raises:
        InvalidValueError: for a key that config.yaml has of every run.
    """
    if taken := [key for key in NOTED if key in own]:
        raise InvalidValueError(
            f"{name} declares {taken[0]}, which config.yaml says of every run: give it another name"
        )
    OWN_KEYS[name] = own

    def decorate(function: Callable[[DictConfig], None]) -> Callable[..., None]:
        with told_in_words():
            file = Path(function.__code__.co_filename)
            check_checkout(file)
            check_name(file, name)

        @functools.wraps(function)
        def body(config: DictConfig) -> None:
            check_config(config, name)
            check_machine(plain(config))
            import torch

            torch.set_num_threads(config.torch_threads)
            logging.getLogger("torchrl").setLevel(logging.WARNING)
            function(_with_origin(name, config))

        return command_line(body, CONFIGS, name, partial(check_config, name=name))

    return decorate


def _with_origin(name: str, config: DictConfig) -> DictConfig:
    """A copy of the config that says which recipe and piece it is of, as config.yaml and checkpoints of a run then do.

    Two recipes that were given one system find out by it, and so does a run whose file of furniture has changed: the
    second does not go on with what the first has left.
    """
    from tstar_rl.env.task_tables import furniture_digest

    config = deepcopy(config)
    with open_dict(config):
        config.recipe = name
        config[FURNITURE] = furniture_digest(config.task.name)
    return config


def own_keys(name: str) -> dict[str, Any]:
    """The keys that only the recipe `name` has, and their types; where it is not what runs here, its file is read."""
    if name not in OWN_KEYS:
        sys.path.insert(0, str(RECIPES))  # some recipes import their parts from there
        try:
            runpy.run_path(str(RECIPES / f"{name}.py"))
        finally:
            sys.path.remove(str(RECIPES))
    return OWN_KEYS[name]


def check_name(recipe: Path, name: str) -> None:
    """Checks that a recipe in a folder of recipes has the name of its file: a copy would run as what it is a copy of.

    Raises:
        ConfigError: if it has another.
    """
    if recipe.parent.name == "recipes" and recipe.stem != name:
        raise ConfigError(
            f'{recipe} is the recipe "{name}" by its @rl.recipe: name it "{recipe.stem}" there, and give '
            f"configs/recipe/{recipe.stem}.yaml a system of that name"
        )


def check_checkout(recipe: Path) -> None:
    """Checks that a recipe which lies in a checkout of the library runs with the code and the configs of that checkout.

    In a worktree of git with the environment of the first checkout, Python finds the first one's code.

    Raises:
        ConfigError: if it does not; it says what to do.
    """
    here, there = CONFIGS.parent, recipe.resolve().parent.parent
    if there != here and (there / "tstar_rl" / "__init__.py").is_file():
        raise ConfigError(
            f"{recipe} would run with the code of {here}: install {there} in an environment of its own, "
            f"or set PYTHONPATH={there}:{there / 'envs'}"
        )


@contextmanager
def imports_not_collected() -> Iterator[None]:
    """Spares garbage collection what is imported meanwhile: a million objects of TorchRL's modules, which all stay.

    Python would look through them again and again, for a fifth of the time that they take to import.
    """
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if collects:
            gc.enable()


def check_config(config: DictConfig, name: str) -> None:
    """Checks all names, types and ranges in the config of the recipe `name`.

    Raises:
        ConfigError: see `check.check`, `ranges.check_ranges_of` and `unread.check_what_is_not_read`; also for an
            unknown task, a wrong number of subtasks, and unknown settings of the task or values of them.
    """
    values, own = plain(config), own_keys(name)
    check(values, Config, "", own)
    if name not in OURS:  # what a key of a user's own recipe may be, only that recipe knows
        ours = {key for key, kind in own.items() if kind is Section or key == "from_checkpoint"}
        values = {key: value for key, value in values.items() if key not in own or key in ours}
    check_ranges_of(values)
    check_what_is_not_read(values, name)
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
    mixture = RewardMixture(**values["reward"])  # both say what is wrong with their section
    TerminalStateReward(nn.Identity(), **values["terminal_reward"])
    _check_the_last_skill_is_paid(mixture.effective_weights())


def _check_the_last_skill_is_paid(paid: dict[str, float]) -> None:
    """Raises ConfigError if only what a next skill says is paid: the last skill would have nothing to learn from."""
    if not any(weight for term, weight in paid.items() if term not in SAID_BY_THE_NEXT):
        raise ConfigError(
            "reward.weights must pay env, gail or a term of your own: the last skill has no next one, so tsr and "
            f"proximity pay it nothing; got {paid} with scales and reward_scale in it"
        )
