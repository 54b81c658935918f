"""What the values in a config may be, where their type alone does not say it: told before a recipe begins."""

import re
from collections.abc import Mapping
from typing import Any

from omegaconf import DictConfig

from tstar_rl.checks import RANGES, need_extra
from tstar_rl.config.check import ConfigError
from tstar_rl.config.limits import (
    CHOICES,
    CHOICES_OF_LISTS,
    KINDS_OF_NUMBERS,
    LEAST,
    MOST,
    NAMES,
    NOT_EMPTY,
)
from tstar_rl.demonstrations.header import unknown_setting
from tstar_rl.runs.run_folder import is_inside_a_run

__all__ = ["chain_length", "check_machine", "check_ranges_of", "find", "turn_shape"]


def check_ranges_of(values: Mapping[str, Any]) -> None:
    """Checks the values of a config whose names and types are right.

    Raises:
        InvalidValueError: for the first that is out of its range; it names the key, what was got and what is valid.
    """
    _check_numbers(values)
    _check_words(values)
    _check_lists(values)
    _check_together(values)
    _check_task(values["task"]["name"], values["task"]["subtasks"], values)


def _check_numbers(values: Mapping[str, Any]) -> None:
    for name, least in LEAST.items():
        value = find(values, name)
        if value is not None and value < least:
            raise ConfigError(f"{name} must be a whole number from {least}, got {value}")
    for name, most in MOST.items():
        value = find(values, name)
        if value is not None and value > most:
            raise ConfigError(f"{name} must be a whole number up to {most}, got {value}")
    for name, kind in KINDS_OF_NUMBERS.items():
        value, (said, fits) = find(values, name), RANGES[kind]
        if value is not None and not fits(value):
            raise ConfigError(f"{name} must be {said}, got {value}")


def _check_words(values: Mapping[str, Any]) -> None:
    for name, valid in CHOICES.items():
        if (value := find(values, name)) is not None and value not in valid:
            said = ", ".join("null" if one is None else one for one in valid)
            raise ConfigError(f"{name} must be one of {said}; got {value!r}")
    for name in NAMES:
        value = values.get(name)
        if value is not None and any(part in ("", ".", "..") for part in value.split("/")):
            raise ConfigError(f"{name} must be a name, or names joined by /, got {value!r}")
        if value is not None and (taken := next(filter(is_inside_a_run, value.split("/")), None)):
            raise ConfigError(
                f"{name} must not have the part {taken}, a folder inside of runs; got {value!r}"
            )
    if told := unknown_setting(find(values, "demonstrations.may_differ") or ()):
        raise ConfigError(f"demonstrations.may_differ has {told}")


def _check_lists(values: Mapping[str, Any]) -> None:
    for name in NOT_EMPTY:
        if find(values, name) in ([], {}):
            raise ConfigError(f"{name} must name at least one, got none: there would be nothing to do")
    for name, choices in CHOICES_OF_LISTS.items():
        for value in find(values, name) or ():
            if value not in choices:
                raise ConfigError(f"each {name[:-1]} must be one of {', '.join(choices)}; got {value!r}")
        given = find(values, name) or ()
        if len(set(given)) < len(given):
            raise ConfigError(f"{name} must name each once, got {', '.join(given)}")
    seeds = values.get("seeds") or ()
    for seed in seeds:
        if not 0 <= seed <= MOST["seed"]:
            raise ConfigError(f"seeds must be whole numbers from 0 to {MOST['seed']}, got {seed}")
    if len(set(seeds)) < len(seeds):
        raise ConfigError(f"seeds must name each once, got {', '.join(map(str, seeds))}")
    for floor in values.get("floors") or ():
        if not floor > 0:
            raise ConfigError(f"floors must be positive, got {values['floors']}")


def _check_together(values: Mapping[str, Any]) -> None:
    """What a value may be beside another one."""
    every, gate = find(values, "chain.trial_every"), find(values, "chain.gate")
    if find(values, "chain.order") == "costliest" and not gate and every != 1:
        raise ConfigError(
            f"chain.order=costliest needs a trial after every turn: chain.gate=true or chain.trial_every=1, got {every}"
        )
    simulations, workers = find(values, "training.num_envs"), find(values, "collection.workers")
    if find(values, "collection.backend") == "ray" and simulations and simulations % workers:
        raise ConfigError(
            f"training.num_envs must be a multiple of collection.workers, got {simulations} simulations for {workers}"
        )
    capacity, first = find(values, "spirl.capacity"), find(values, "spirl.policy.first")
    if capacity is not None and first is not None and capacity < first:
        raise ConfigError(
            f"spirl.capacity must be at least spirl.policy.first, the latents before the first update: got {capacity} "
            f"and {first}"
        )


def _check_task(task: str, subtasks: int, values: Mapping[str, Any]) -> None:
    """The numbers that depend on how many subtasks the task has."""
    if (subtask := values["subtask"]) is not None and not 0 <= subtask < subtasks:
        valid = f"null (the whole task) or in 0..{subtasks - 1}"
        raise ConfigError(f"subtask of {task} must be {valid}, got {subtask}")
    if subtask is not None and find(values, "whole"):
        raise ConfigError(f"whole=true is of the whole task: subtask must be null, got {subtask}")
    _check_links(find(values, "chain.links"), subtasks, task)


def chain_length(config: DictConfig) -> int:
    """How many skills are chained: chain.links, or all of the task's.

    Raises:
        ConfigError: if chain.links is not between 2 and the number of subtasks.
    """
    _check_links(config.chain.links, config.task.subtasks, config.task.name)
    return config.chain.links or config.task.subtasks


def turn_shape(config: Mapping[str, Any]) -> tuple[int, int]:
    """Rollouts of a chain's turn, at least one, and environment steps of a rollout."""
    training, chain = config["training"], config["chain"]
    frames = training["num_envs"] * (chain["horizon"] or training["horizon"])
    return max(chain["steps_per_turn"] // frames, 1), frames


def _check_links(links: int | None, subtasks: int, task: str) -> None:
    if links is not None and not 2 <= links <= subtasks:
        raise ConfigError(f"chain.links must be null or in 2..{subtasks} for {task}, got {links}")


def check_machine(values: Mapping[str, Any]) -> None:
    """Checks that this machine has what a config asks for: the GPU, its simulator, Ray.

    Raises:
        ConfigError: for a device that this machine does not have.
        MissingExtraError: for an optional dependency, with the command that installs it.
    """
    import torch

    device = values["device"]
    if not re.fullmatch(r"cpu|cuda(:\d+)?", device):
        raise ConfigError(f"device must be cpu, cuda or cuda:<number>, got {device!r}")
    if device != "cpu" and not torch.cuda.is_available():
        raise ConfigError(f"device={device}: torch finds no CUDA device on this machine; device=cpu works")
    if device.startswith("cuda:") and int(device[5:]) >= (count := torch.cuda.device_count()):
        raise ConfigError(f"device={device}: torch finds cuda:0 to cuda:{count - 1} on this machine")
    if device != "cpu" or values["physics"] == "warp":
        need_extra("mujoco_warp", "gpu", "device=cuda or physics=warp")
    if "ray" in (values["launch"], find(values, "collection.backend")):
        need_extra("ray", "ray", "launch=ray or collection.backend=ray")


def find(values: Mapping[str, Any], name: str) -> Any:
    """Returns the value at a dotted name; None where there is none."""
    found: Any = values
    for part in name.split("."):
        if not isinstance(found, Mapping) or part not in found:
            return None
        found = found[part]
    return found
