"""Reads robomimic-style HDF5 and checks it; an error names the file, the demonstration, the key and what is valid.

A file is read whole before anything is made of it: one that is wrong anywhere gives nothing.
"""

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tstar_rl.checks import MissingFileError
from tstar_rl.demonstrations.formats.hdf5 import OBSERVATION_KEY, h5py
from tstar_rl.demonstrations.header import DemonstrationError, unknown_setting

__all__ = ["Contents", "read_contents"]

PER_STEP = ("rewards", "terminations", "truncations", "successes")
STATES = ("states", "final_state")
ACTIONS = ("actions", "expert_actions")
OF_THE_FRONT = ("reward_scale", "render_mode", "width", "height", "num_envs", "nthread", "autoreset_mode")
"""What Gymnasium's environments take beside the settings: it says nothing of the world, and is left out."""


@dataclass(frozen=True)
class Contents:
    """What a file holds.

    Attributes:
        task, subtask: what was done; subtask None is the whole task.
        settings: of the environment, as far as the file says.
        attributes: of the group `data`, less `env_args`.
        demos: by name and in order, arrays by key: "observations" (T, O) and "actions" (T, 9) float32 in all of them;
            "next_observations", "expert_actions", and those of `PER_STEP` and `STATES` (float64), where they are there.
        seeds: of the environments, one for each demonstration; 0 where the file says nothing.
    """

    task: str
    subtask: int | None
    settings: dict[str, Any]
    attributes: dict[str, Any]
    demos: dict[str, dict[str, np.ndarray]]
    seeds: list[int]


def read_contents(
    path: str | Path,
    observation_key: str | None = None,
    filter_key: str | None = None,
    failures: bool = False,
) -> Contents:
    """Reads and checks a file.

    Args:
        path: of the file.
        observation_key: the array below `obs` that holds the environment's observations; None: `OBSERVATION_KEY`.
        filter_key: the list below `mask` of the demonstrations to read; None: all.
        failures: whether those that say they failed are read too; else they are an error.

    Raises:
        MissingFileError: there is no file.
        MissingExtraError: h5py is not installed.
        DemonstrationError: names what is wrong.
    """
    library = h5py()
    if not Path(path).is_file():
        raise MissingFileError(f"no demonstrations at {path}: an HDF5 file, as recipes/export.py writes it")
    reader = _Reader(path, observation_key or OBSERVATION_KEY, filter_key, failures)
    try:
        with library.File(path, "r") as file:
            return reader.read(file)
    except DemonstrationError:
        raise
    except Exception as error:  # HDF5, its filters and h5py each have errors of their own for damage
        raise DemonstrationError(
            f"{path}{reader.place} cannot be read (damaged, truncated or not HDF5?): {error}"
        ) from error


class _Reader:
    """Reads one file; `place` says where in it the reader is."""

    def __init__(
        self, path: str | Path, observation_key: str, filter_key: str | None, failures: bool
    ) -> None:
        self.path, self.observation_key, self.filter_key = path, observation_key, filter_key
        self.failures, self.place = failures, ""

    def read(self, file: Any) -> Contents:
        from tstar_rl.env.task_tables import observation_dim

        if "data" not in file or not hasattr(file["data"], "attrs") or not hasattr(file["data"], "keys"):
            raise self._wrong(f"group data is missing; the file has {_listed(file)}")
        attributes = dict(file["data"].attrs)
        task, subtask, settings = self._environment(attributes)
        names, width = self._names(file), observation_dim(task)
        demos = {name: self._demo(file["data"][name], name, width) for name in names}
        seeds = [self._whole(file["data"][name], "seed", 0) for name in names]
        return Contents(task, subtask, settings, attributes, demos, seeds)

    def _environment(self, attributes: dict[str, Any]) -> tuple[str, int | None, dict[str, Any]]:
        """Task, subtask and settings of the attribute `env_args`, which it takes out."""
        from tstar_rl.env.task_tables import subtask_geometry
        from tstar_rl.env.their_names import task_called

        self.place = ": attribute env_args of data"
        wanted = 'JSON such as {"env_name": "tstar/<Name>-v0", "env_kwargs": {"subtask": 0}}'
        try:
            env_args = json.loads(attributes.pop("env_args"))
            settings = dict(env_args.get("env_kwargs") or {})
            name = settings.pop("task", None) or env_args["env_name"]
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise self._wrong(f"is missing or not what it should be, which is {wanted}") from error
        subtask = settings.pop("subtask", None)
        settings = {key: value for key, value in settings.items() if key not in OF_THE_FRONT}
        if told := unknown_setting(settings):
            raise self._wrong(f"has env_kwargs {told}")
        if subtask is not None and (not isinstance(subtask, int) or isinstance(subtask, bool)):
            raise self._wrong(f"has subtask {subtask!r}, should be null (the whole task) or 0, 1, ...")
        try:
            task = task_called(str(name))
            if subtask is not None:
                subtask_geometry(task, subtask)
        except ValueError as error:
            raise self._wrong(f"names no task: {error}") from error
        self.place = ""
        return task, subtask, settings

    def _names(self, file: Any) -> list[str]:
        """The demonstrations to read, in the order of their numbers."""
        names = list(file["data"])
        for name in names:
            if not re.fullmatch(r"demo_\d+", name):
                raise self._wrong(f"data has {name}; demonstrations are called demo_0, demo_1, ...")
        if self.filter_key is not None:
            masks = list(file.get("mask", {}))
            if self.filter_key not in masks:
                raise self._wrong(f"mask has no {self.filter_key}; it has {_listed(masks)}")
            chosen = [_text(name) for name in file["mask"][self.filter_key][()]]
            if lost := sorted({*chosen} - {*names}):
                raise self._wrong(f"mask/{self.filter_key} names {_listed(lost)}, which data does not have")
            names = chosen
        if not names:
            raise self._wrong("there is no demonstration: data needs groups demo_0, demo_1, ...")
        return sorted(set(names), key=lambda name: int(name.removeprefix("demo_")))

    def _demo(self, group: Any, name: str, width: int) -> dict[str, np.ndarray]:
        """The arrays of one demonstration."""
        self.place = f": {name}"
        key = f"obs/{self.observation_key}"
        for needed in ("actions", key):
            if needed not in group:
                hint = " (demonstrations.observation_key=... names another)" if needed == key else ""
                below = f"; obs has {_listed(group['obs'])}" if "obs" in group else ""
                raise self._wrong(f"has no {needed}{hint}; it has {_listed(group)}{below}")
        shape = self._dataset(group, "actions").shape
        steps = shape[0] if shape else 0
        self.place = f": {name}"
        if (said := self._whole(group, "num_samples", steps)) != steps or not steps:
            raise self._wrong(
                f"has {steps} actions, and num_samples is {said}; both should be the same, from 1"
            )
        won = self._whole(group, "success", 1)
        if won not in (0, 1):
            raise self._wrong(f"has attribute success {won}, should be true or false, or 1 or 0")
        if not (won or self.failures):
            told = "leave it out of the file, or name a list below mask by demonstrations.filter_key"
            if "successes" in group.file.get("mask", {}) and self.filter_key != "successes":
                told = "demonstrations.filter_key=successes leaves out those that failed"
            raise self._wrong(f"did not succeed; {told}")
        shapes = {key: (steps, width), "actions": (steps, 9), "expert_actions": (steps, 9)}
        shapes |= {f"next_{key}": (steps, width), **dict.fromkeys(PER_STEP, (steps,))}
        for each, rows in (("states", (steps,)), ("final_state", ())):
            if each in group:
                shapes[each] = (*rows, *self._dataset(group, each).shape[-1:])
        names = {key: "observations", f"next_{key}": "next_observations"}
        found = {names.get(k, k): self._array(group, k, shape) for k, shape in shapes.items() if k in group}
        self.place = ""
        return found

    def _whole(self, group: Any, name: str, default: int) -> int:
        """An attribute that is a whole number or a flag."""
        value = np.asarray(found := group.attrs.get(name, default))
        if (
            value.shape
            or value.dtype.kind not in "biuf"
            or not (float(value).is_integer() and abs(float(value)) < 2**63)
        ):
            wanted = "true or false" if name == "success" else "a whole number of 64 bits"
            said = found.item() if isinstance(found, np.generic) else found
            self.place = f": {group.name.rpartition('/')[2]}"
            raise self._wrong(f"has attribute {name} {said!r}, should be {wanted}")
        return int(value)

    def _dataset(self, group: Any, key: str) -> Any:
        self.place = f": {group.name.rpartition('/')[2]}/{key}"
        if not hasattr(group[key], "shape"):
            raise self._wrong("is a group, should be an array")
        return group[key]

    def _array(self, group: Any, key: str, shape: tuple[int, ...]) -> np.ndarray:
        dataset = self._dataset(group, key)
        if dataset.dtype.kind not in "fiub":
            raise self._wrong(f"has type {dataset.dtype}, should be numbers")
        if dataset.shape != shape:
            raise self._wrong(f"has shape {dataset.shape}, should be {shape}{_meaning(key)}")
        with np.errstate(over="ignore"):  # what is too large for the type is told below
            array = dataset[()].astype(np.float64 if key in STATES else np.float32)
        if not np.isfinite(array).all():
            raise self._wrong(f"has values that are not finite, first in row {_first(~np.isfinite(array))}")
        if key in ACTIONS and (outside := np.abs(array) > 1).any():
            raise self._wrong(f"has {array[outside][0]:.9g} in row {_first(outside)}; actions are in [-1, 1]")
        return array

    def _wrong(self, what: str) -> DemonstrationError:
        return DemonstrationError(f"{self.path}{self.place or ':'} {what}")


def _meaning(key: str) -> str:
    """What the numbers of a row are."""
    if key in ACTIONS:
        return ": 7 joint velocities, gripper, connect"
    return ": 29 for the robot, 7 a part, 8 phases" if "obs/" in key else ""


def _first(where: np.ndarray) -> int:
    return int(np.argwhere(where)[0][0])


def _text(name: Any) -> str:
    return name.decode() if isinstance(name, bytes) else str(name)


def _listed(names: Any) -> str:
    return ", ".join(map(str, names)) or "nothing"
