"""Checkpoints on `torchrl.checkpoint`: tensors and JSON, written atomically, no pickle.

Each carries a record of what it belongs to (task, recipe, config, ...), and is checked against it when loaded.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torchrl.checkpoint import Checkpoint, CheckpointRotation

__all__ = [
    "CheckpointMismatchError",
    "differences",
    "latest",
    "load",
    "read_record",
    "save",
    "save_step",
    "to_plain",
    "to_tensors",
    "to_tuples",
]


class CheckpointMismatchError(ValueError):
    """A checkpoint belongs to something else."""


def save(path: str | Path, components: Mapping[str, Any], record: Mapping[str, Any]) -> None:
    """Writes the components (with `state_dict`) and the record to `path`, replacing what was there."""
    Checkpoint(**components).save(path, metadata=dict(record))


def save_step(
    directory: str | Path,
    step: int,
    components: Mapping[str, Any],
    record: Mapping[str, Any],
) -> None:
    """Writes the checkpoint of a step below `directory`; the one before goes once the new one is complete."""
    rotation = CheckpointRotation(directory, keep_last=1)
    rotation.save(Checkpoint(**components), step=step, metadata=dict(record))


def latest(directory: str | Path) -> Path | None:
    """The newest complete checkpoint below `directory`."""
    return CheckpointRotation(directory, keep_last=1).latest()


def read_record(path: str | Path, **expected: Any) -> dict[str, Any]:
    """The record of the checkpoint at `path`.

    Raises:
        FileNotFoundError: if there is no checkpoint.
        CheckpointMismatchError: if an `expected` value is not the recorded one.
    """
    if not Checkpoint.is_checkpoint(path):
        raise FileNotFoundError(f"no checkpoint at {path}")
    record = Checkpoint.manifest(path)["metadata"]
    wrong = differences({name: record.get(name) for name in expected}, expected)
    if wrong:
        raise CheckpointMismatchError(f"{path} does not belong here: " + "; ".join(wrong))
    return record


def load(path: str | Path, components: Mapping[str, Any], **expected: Any) -> dict[str, Any]:
    """Restores the components and returns the record; see `read_record` for what is raised."""
    record = read_record(path, **expected)
    Checkpoint(**components).load(path, map_location="cpu")  # a component knows its own device
    return record


def differences(saved: Any, wanted: Any, name: str = "") -> list[str]:
    """Readable differences of two nested plain values."""
    if isinstance(saved, Mapping) and isinstance(wanted, Mapping):
        return [
            text
            for key in sorted({*saved, *wanted}, key=str)
            for text in differences(saved.get(key), wanted.get(key), f"{name}.{key}" if name else str(key))
        ]
    saved, wanted = (list(value) if isinstance(value, tuple) else value for value in (saved, wanted))
    return [] if saved == wanted else [f"{name} was {saved!r} when it was saved, and is {wanted!r} now"]


def to_plain(values: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Values for a record, tensors as lists; None stays None."""
    if values is None:
        return None
    return {k: v.tolist() if isinstance(v, torch.Tensor) else v for k, v in values.items()}


def to_tensors(values: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """What `to_plain` was given, with every list a tensor."""
    if values is None:
        return None
    return {k: torch.tensor(v) if isinstance(v, list) else v for k, v in values.items()}


def to_tuples(values: Mapping[str, Any]) -> dict[str, Any]:
    """Fields of a settings object from a record, with every list a tuple."""
    return {k: tuple(v) if isinstance(v, list) else v for k, v in values.items()}
