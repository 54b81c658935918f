"""Demonstrations on disk: written atomically, and read with every field checked.

One `.npz` file without pickled objects. E episodes of L_e steps are laid end to end, S = sum of L_e rows.
"""

import json
import os
import zipfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

__all__ = ["KINDS", "DemonstrationError", "Demonstrations"]

FORMAT_VERSION = 1
KINDS = ("plain", "noisy")


class DemonstrationError(ValueError):
    """A file of demonstrations is not what it should be; the message names file and field."""


@dataclass
class Demonstrations:
    """Successful episodes of the scripted expert.

    Attributes:
        task, subtask: what was done; subtask None is the whole task.
        kind: "plain", or "noisy": the executed action was perturbed, the label is clean.
        arguments: of the environment, plain values.
        seeds: (E,) int64, of the environment that each episode came from.
        lengths: (E,) int64.
        observations: (S, 72) float32, before the action.
        actions: (S, 9) float32, the expert's labels.
        executed: (S, 9) float32, what the environment was given.
        success: (E,) bool.
        snapshots: batch [S], the states before the actions.
    """

    task: str
    subtask: int | None
    kind: str
    arguments: dict[str, Any]
    seeds: Tensor
    lengths: Tensor
    observations: Tensor
    actions: Tensor
    executed: Tensor
    success: Tensor
    snapshots: TensorDictBase

    def __len__(self) -> int:
        return len(self.lengths)

    def to(self, device: torch.device | str) -> "Demonstrations":
        """The same with what is learnt from on a device; snapshots stay."""
        learnt = {name: getattr(self, name).to(device) for name in ("observations", "actions", "executed")}
        return replace(self, **learnt)

    def save(self, path: str | Path) -> None:
        """Writes the file; one that is there stays whole until the new one is complete."""
        header = {
            "format_version": FORMAT_VERSION,
            "task": self.task,
            "subtask": self.subtask,
        }
        header |= {"kind": self.kind, "arguments": self.arguments}
        arrays = {name: getattr(self, name).numpy() for name in _ARRAYS}
        for key, value in self.snapshots.items(True, True):
            arrays["snapshot/" + (key if isinstance(key, str) else "/".join(key))] = value.numpy()
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(path.name + ".partial")
        with partial.open("wb") as file:
            np.savez_compressed(file, header=np.array(json.dumps(header)), **arrays)
        os.replace(partial, path)

    @classmethod
    def load(cls, path: str | Path, task: str | None = None, subtask: int | None = None) -> "Demonstrations":
        """Reads and checks the file, and that it is of `task` and `subtask` where these are given.

        Raises:
            FileNotFoundError: if there is no file.
            DemonstrationError: names the field that is wrong.
        """
        if not Path(path).is_file():
            raise FileNotFoundError(
                f"no demonstrations at {path}: recipes/make_demonstrations.py writes them"
            )
        try:
            with np.load(path, allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
        except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
            raise DemonstrationError(f"{path} cannot be read (truncated or not .npz?): {error}") from error
        header = _read_header(path, arrays)
        if task is not None and (header["task"], header["subtask"]) != (task, subtask):
            raise DemonstrationError(
                f"{path}: field task, subtask is {header['task']}, {header['subtask']}; wanted {task}, {subtask}"
            )
        _check(path, arrays)
        rows = int(arrays["lengths"].sum())
        leaves = {
            tuple(name.split("/")[1:]): torch.from_numpy(a)
            for name, a in arrays.items()
            if name.startswith("snapshot/")
        }
        snapshots = TensorDict({}, [rows])
        for key, leaf in leaves.items():
            snapshots[key] = leaf
        return cls(
            **header,
            **{name: torch.from_numpy(arrays[name]) for name in _ARRAYS},
            snapshots=snapshots,
        )


_ARRAYS: dict[str, tuple[str, int | None, np.dtype]] = {
    "seeds": ("episodes", None, np.dtype(np.int64)),
    "lengths": ("episodes", None, np.dtype(np.int64)),
    "success": ("episodes", None, np.dtype(bool)),
    "observations": ("rows", 72, np.dtype(np.float32)),
    "actions": ("rows", 9, np.dtype(np.float32)),
    "executed": ("rows", 9, np.dtype(np.float32)),
}


def _read_header(path: str | Path, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    try:
        header = json.loads(str(arrays["header"]))
    except (KeyError, json.JSONDecodeError) as error:
        raise DemonstrationError(f"{path}: field header is missing or not JSON") from error
    for name in ("format_version", "task", "subtask", "kind", "arguments"):
        if name not in header:
            raise DemonstrationError(f"{path}: field {name} is missing from the header")
    if header["format_version"] != FORMAT_VERSION:
        raise DemonstrationError(
            f"{path}: field format_version is {header['format_version']}; this code reads {FORMAT_VERSION}"
        )
    if header["kind"] not in KINDS:
        raise DemonstrationError(f"{path}: field kind is {header['kind']!r}; valid: {', '.join(KINDS)}")
    del header["format_version"]
    return header


def _check(path: str | Path, arrays: dict[str, np.ndarray]) -> None:
    for name, (_, _, dtype) in _ARRAYS.items():
        if name not in arrays:
            raise DemonstrationError(f"{path}: field {name} is missing")
        if arrays[name].dtype != dtype:
            raise DemonstrationError(f"{path}: field {name} has type {arrays[name].dtype}, should be {dtype}")
    lengths = arrays["lengths"]
    if lengths.ndim != 1 or not len(lengths) or (lengths < 1).any():
        raise DemonstrationError(f"{path}: field lengths must be positive numbers, one an episode")
    sizes = {"episodes": len(lengths), "rows": int(lengths.sum())}
    for name, (size, width, _) in _ARRAYS.items():
        shape = (sizes[size],) if width is None else (sizes[size], width)
        if arrays[name].shape != shape:
            raise DemonstrationError(
                f"{path}: field {name} has shape {arrays[name].shape}, should be {shape}"
            )
        if arrays[name].dtype.kind == "f" and not np.isfinite(arrays[name]).all():
            raise DemonstrationError(f"{path}: field {name} has values that are not finite")
    snapshots = [name for name in arrays if name.startswith("snapshot/")]
    if not snapshots:
        raise DemonstrationError(f"{path}: field snapshot is missing")
    for name in snapshots:
        if arrays[name].shape[:1] != (sizes["rows"],):
            raise DemonstrationError(
                f"{path}: field {name} has {arrays[name].shape[:1]} rows, should have {sizes['rows']}"
            )
