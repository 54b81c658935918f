"""Checkpoints on `torchrl.checkpoint`: tensors and JSON, written atomically, no pickle, a checksum for every file.

Each carries a record of what it belongs to (task, recipe, config, ...), and is checked against it when loaded. What is
not as it was written is refused by the name of its file: see `checksums`.
"""

import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

import torch
from torchrl.checkpoint import (
    Checkpoint,
    CheckpointError,
    CheckpointRotation,
    StateDictCheckpointAdapter,
)

from tstar_rl.checks import InvalidValueError, MissingFileError, UserError
from tstar_rl.runs.checksums import LITTER, SEAL, DamagedCheckpointError, read_seal, seal, verify
from tstar_rl.runs.files import named_in_errors, remove_remains, replacing_folder
from tstar_rl.runs.mismatch import CheckpointMismatchError, differences
from tstar_rl.runs.run_folder import made_by

__all__ = [
    "DamagedCheckpointError",
    "check_place",
    "is_checkpoint",
    "latest",
    "load",
    "read_record",
    "save",
    "save_step",
    "settings_of",
    "to_plain",
    "to_tensors",
]

Settings = TypeVar("Settings")
MANIFEST = "manifest.json"
PARTS = (MANIFEST, SEAL, "components")
"""What lies in a checkpoint's folder."""


class _SealedCheckpoint(Checkpoint):
    """A checkpoint that is sealed before it takes its place, in one step with it.

    Tensors of a component are one archive. As the memory-mapped files that torchrl writes by default, they would end
    the process with a bus error where the disk is full; this way it is an `OSError`, and the checkpoint before stays.
    """

    def __init__(self, components: Mapping[str, Any]) -> None:
        super().__init__()
        for name, component in components.items():
            self.register(name, component, adapter=StateDictCheckpointAdapter("archive"))

    def save(self, path: str | Path, **options: Any) -> Path:
        destination = _place(path)
        with named_in_errors(destination), replacing_folder(destination) as stage:
            super().save(stage, **options)
            seal(stage)
        return destination


def _place(path: str | Path) -> Path:
    """Absolute, so that torchrl does not take a ~ in it for the home folder: nothing else here does."""
    return Path(path).absolute()


def save(path: str | Path, components: Mapping[str, Any], record: Mapping[str, Any]) -> None:
    """Writes the components (with `state_dict`) and the record to `path`, replacing the checkpoint that was there.

    Raises:
        InvalidValueError: see `check_place`.
    """
    check_place(path)
    _SealedCheckpoint(components).save(path, metadata=dict(record))


def save_step(
    directory: str | Path,
    step: int,
    components: Mapping[str, Any],
    record: Mapping[str, Any],
) -> None:
    """Writes the checkpoint of a step below `directory`; the one before goes once the new one is complete."""
    rotation = CheckpointRotation(_place(directory), keep_last=1)
    remove_remains(rotation.directory / rotation.prefix)
    rotation.save(_SealedCheckpoint(components), step=step, metadata=dict(record))


def latest(directory: str | Path) -> Path | None:
    """The newest checkpoint below `directory`, damaged or not: `load` refuses one that is."""
    steps = {
        int(found[1]): path
        for path in Path(directory).glob("checkpoint-*")
        if (found := re.fullmatch(r"checkpoint-(\d+)", path.name))
    }
    return steps[max(steps)] if steps else None


def is_checkpoint(path: str | Path) -> bool:
    """Whether there is a checkpoint at `path`, damaged or not."""
    return any((Path(path) / part).exists() for part in PARTS)


def check_place(path: str | Path) -> None:
    """Checks that nothing but a checkpoint, or a chain of them, would be lost if one took the place of what is there.

    Raises:
        InvalidValueError: there is a file, or a folder that holds anything else; it is named, and stays.
    """
    path = Path(path)
    if path.exists() and not path.is_dir():
        raise InvalidValueError(f"{path} is a file: a checkpoint is a folder; give another path")
    skills = [each for each in path.glob("skill*") if re.fullmatch(r"skill\d+", each.name) and each.is_dir()]
    others = sorted(str(name.relative_to(path)) for each in (path, *skills) for name in _others(each, skills))
    if others:
        raise InvalidValueError(
            f"{path} holds {others[0]}{' and more' if others[1:] else ''}, which a checkpoint there would replace: "
            "give a path that is new, empty or a checkpoint"
        )


def _others(folder: Path, skills: Sequence[Path]) -> list[Path]:
    """What lies in a folder and is no part of a checkpoint, nor one of these skills of a chain."""
    parts = PARTS if any((folder / name).is_file() for name in (MANIFEST, SEAL)) else ()
    inside = [each for each in folder.glob("*") if each.name not in parts and each not in skills]
    return [each for each in inside if not re.fullmatch(LITTER, each.name)]


def read_record(path: str | Path, /, **expected: Any) -> dict[str, Any]:
    """The record of the checkpoint at `path`.

    Raises:
        MissingFileError: if there is no checkpoint; a FileNotFoundError.
        DamagedCheckpointError: if the file with the record is not as it was written.
        CheckpointMismatchError: if an `expected` value is not the recorded one.
    """
    if not is_checkpoint(path):
        near = [place for place in (Path(path, "last"), Path(path, "skill0")) if is_checkpoint(place)]
        raise MissingFileError(
            f"no checkpoint at {path}{f': there is one at {near[0]}' if near else made_by(path)}"
        )
    verify(Path(path), only=[MANIFEST])
    record = Checkpoint.manifest(_place(path))["metadata"]
    wrong = differences({name: record.get(name) for name in expected}, expected)
    if wrong:
        raise CheckpointMismatchError(f"{path} does not belong here: " + "; ".join(wrong))
    return record


def load(path: str | Path, components: Mapping[str, Any], /, **expected: Any) -> dict[str, Any]:
    """Restores the components and returns the record, once every file is known to be as it was written.

    Raises:
        MissingFileError, DamagedCheckpointError, CheckpointMismatchError: see `read_record`; also a mismatch if the
            components are not those that were saved, and damaged if a file holds a pickle, which is not read: it could
            run any code, and no checkpoint that was saved here has one.
    """
    record = read_record(path, **expected)
    files = verify(Path(path))
    try:
        with _no_pickle():
            _SealedCheckpoint(components).load(
                _place(path), map_location="cpu"
            )  # a component knows its own device
    except CheckpointError as error:
        if isinstance(error.__cause__, FutureWarning):
            raise DamagedCheckpointError(
                f"{path} holds pickled data, which could run any code and is in no checkpoint that was saved here: "
                "nothing of it was read"
            ) from error
        if isinstance(error.__cause__, UserError):
            raise error.__cause__ from error
        raise CheckpointMismatchError(f"{path} was saved by other code or settings: {error}") from error
    if read_seal(Path(path)) != files:
        raise DamagedCheckpointError(f"{path} was replaced while it was read: read it again")
    return record


@contextmanager
def _no_pickle() -> Iterator[None]:
    """Makes an error of TensorDict's warning that it is about to read a pickle; torchrl does not let us forbid it."""
    with warnings.catch_warnings():
        warnings.filterwarnings("error", "TensorDict.load_memmap is loading a pickled", FutureWarning)
        yield


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


def settings_of(kind: type[Settings], saved: Mapping[str, Any], what: str) -> Settings:
    """A settings object, a dataclass, from a record of its fields; lists become tuples.

    Raises:
        CheckpointMismatchError: if `what` ("the networks have", say) a setting that this version does not know.
    """
    if unknown := sorted(set(saved) - {field.name for field in fields(kind)}):
        raise CheckpointMismatchError(
            f"{what} a setting {unknown[0]}, which this version of tstar_rl does not know: a newer one saved them"
        )
    return kind(**{name: tuple(value) if isinstance(value, list) else value for name, value in saved.items()})
