"""Demonstrations on disk: written atomically, and read with every field checked.

One `.npz` file without pickled objects. E episodes of L_e steps are laid end to end, S = sum of L_e rows.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from tstar_rl.demonstrations.file_check import (
    ARRAYS,
    FURNITURE,
    NOISE,
    DemonstrationError,
    check_arrays,
    read,
)
from tstar_rl.demonstrations.header import FORMAT_VERSION, HEADER, KINDS, read_header
from tstar_rl.runs.files import replacing, turn_to_write

__all__ = ["Demonstrations"]


@dataclass
class Demonstrations:
    """Successful episodes of an expert.

    Attributes:
        task, subtask: what was done; subtask None is the whole task.
        kind: of the scripted expert "plain", or "noisy": the executed action was perturbed, the label is clean. Or
            "imported", from a user's file (`formats`); such ones are not saved.
        arguments: of the environment, plain values.
        seeds: (E,) int64, of the environment that each episode came from.
        lengths: (E,) int64.
        observations: (S, O) float32, before the action; O is 37 and 7 for each part.
        actions: (S, 9) float32 in [-1, 1], the expert's labels.
        executed: (S, 9) float32 in [-1, 1], what the environment was given.
        success: (E,) bool, all True.
        snapshots: batch [S], the states before the actions; empty where an imported file has none.
        noise: deviation of the arm's executed actions; None where a file does not say.
        furniture: the digest of the task's file of furniture then (`env.task_tables.furniture_digest`); None likewise.
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
    noise: float | None = None
    furniture: str | None = None

    def __len__(self) -> int:
        return len(self.lengths)

    def to(self, device: torch.device | str) -> "Demonstrations":
        """The same with the tensors that training reads on a device; snapshots stay."""
        read = {name: getattr(self, name).to(device) for name in ("observations", "actions", "executed")}
        return replace(self, **read)

    def first(self, episodes: int) -> "Demonstrations":
        """The first so many of them."""
        rows = int(self.lengths[:episodes].sum())
        cut = {name: getattr(self, name)[:episodes] for name in ("seeds", "lengths", "success")}
        cut |= {name: getattr(self, name)[:rows] for name in ("observations", "actions", "executed")}
        snapshots = self.snapshots if self.snapshots.is_empty() else self.snapshots[:rows]
        return replace(self, **cut, snapshots=snapshots)

    def check_of(self, task: str, subtask: int | None) -> None:
        """Raises DemonstrationError if these are of another task or subtask."""
        if (self.task, self.subtask) != (task, subtask):
            raise DemonstrationError(
                f"demonstrations of {task}, subtask {subtask}, are wanted; got those of {self.task}, "
                f"subtask {self.subtask}"
            )

    def and_also(self, other: "Demonstrations") -> "Demonstrations":
        """These and others of the same subtask; their kind and arguments are those of these.

        They have snapshots where both have.

        Raises:
            DemonstrationError: the others are of another task or subtask.
        """
        other.check_of(self.task, self.subtask)
        names = ("seeds", "lengths", "success", "observations", "actions", "executed")
        together = {name: torch.cat([getattr(self, name), getattr(other, name)]) for name in names}
        both = [self.snapshots, other.snapshots]
        bare = any(each.is_empty() for each in both)
        snapshots = TensorDict({}, [len(together["actions"])]) if bare else torch.cat(both)
        return replace(self, **together, snapshots=snapshots)

    def save(self, path: str | Path) -> None:
        """Writes the file; one that is there stays whole until the new one is complete.

        Raises:
            ValueError: they were imported, which are not saved.
            DemonstrationError: names a field that `load` would not take. Nothing is written then.
        """
        if self.kind not in KINDS:
            raise ValueError(f"demonstrations of kind {self.kind} are not saved; valid: {', '.join(KINDS)}")
        header = {"format_version": FORMAT_VERSION, **{name: getattr(self, name) for name in HEADER}}
        arrays = {name: getattr(self, name).cpu().numpy() for name in ARRAYS}
        for name, value in self.snapshots.flatten_keys("/").items():
            arrays[f"snapshot/{name}"] = value.cpu().numpy()
        if self.noise is not None:
            arrays[NOISE] = np.array(self.noise, np.float64)
        if self.furniture is not None:
            arrays[FURNITURE] = np.array(self.furniture)
        path, written = Path(path), np.array(json.dumps(header))
        read_header(path, {"header": written})
        check_arrays(path, header, arrays)
        with turn_to_write(path.parent), replacing(path) as partial, partial.open("wb") as file:
            np.savez_compressed(file, header=written, **arrays)

    @classmethod
    def load(cls, path: str | Path, task: str | None = None, subtask: int | None = None) -> "Demonstrations":
        """Reads and checks the file.

        Args:
            path: of the file.
            task: that it must be of; None: any.
            subtask: likewise, where a task is given; None: the whole task.

        Raises:
            MissingFileError: there is no file; a FileNotFoundError.
            DemonstrationError: names the field that is wrong; also for another task or subtask.
        """
        header, arrays = read(path)
        if task is not None and (header["task"], header["subtask"]) != (task, subtask):
            raise DemonstrationError(
                f"{path}: field task, subtask is {header['task']}, {header['subtask']}; wanted {task}, {subtask}"
            )
        flat = {
            name.removeprefix("snapshot/"): torch.from_numpy(array)
            for name, array in arrays.items()
            if name.startswith("snapshot/")
        }
        snapshots = TensorDict(flat, [int(arrays["lengths"].sum())]).unflatten_keys("/")
        return cls(
            **header,
            **{name: torch.from_numpy(arrays[name]) for name in ARRAYS},
            snapshots=snapshots,
            noise=float(arrays[NOISE]) if NOISE in arrays else None,
            furniture=str(arrays[FURNITURE]) if FURNITURE in arrays else None,
        )
