"""Reads a file of demonstrations and checks every field of it; an error names file, field and what is valid."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from tstar_rl.checks import MissingFileError, UserError
from tstar_rl.env.layout import observation_size

__all__ = ["ARRAYS", "FORMAT_VERSION", "HEADER", "KINDS", "DemonstrationError", "read"]

FORMAT_VERSION = 1
KINDS = ("plain", "noisy")
HEADER = ("task", "subtask", "kind", "arguments")
"""What the header has beside its version."""
ARRAYS: dict[str, tuple[str, int | None, np.dtype]] = {
    "seeds": ("episodes", None, np.dtype(np.int64)),
    "lengths": ("episodes", None, np.dtype(np.int64)),
    "success": ("episodes", None, np.dtype(bool)),
    "observations": ("rows", 0, np.dtype(np.float32)),
    "actions": ("rows", 9, np.dtype(np.float32)),
    "executed": ("rows", 9, np.dtype(np.float32)),
}
"""Length, width (0: that of an observation, by the number of parts) and type of each."""
SNAPSHOTS = ("snapshot/physics", "snapshot/welds")
"""What every snapshot has; the state of the task is the environment's to check."""


END_OF_LIST = 22
"""Bytes at the end of a zip file without a comment; bytes 10 and 11 count its members."""


class DemonstrationError(UserError, ValueError):
    """A file of demonstrations is not what it should be; the message names file and field."""


def read(path: str | Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The header (`HEADER`) and all arrays of a file, checked.

    Raises:
        MissingFileError: if there is no file; a FileNotFoundError.
        DemonstrationError: names the field that is wrong.
    """
    arrays = _arrays(path)
    header = _header(path, arrays)
    sizes = _check_lengths(path, arrays)
    for name in ARRAYS:
        _check_array(path, name, arrays[name], sizes)
    if not arrays["success"].all():
        failed = int(np.flatnonzero(~arrays["success"])[0])
        raise DemonstrationError(f"{path}: field success is False in episode {failed}; all must be successes")
    for name in ("actions", "executed"):
        if (largest := float(np.abs(arrays[name]).max())) > 1:
            raise DemonstrationError(f"{path}: field {name} has {largest:g}; actions are in [-1, 1]")
    _check_snapshots(path, arrays, sizes["rows"])
    return header, arrays


def _arrays(path: str | Path) -> dict[str, np.ndarray]:
    if not Path(path).is_file():
        raise MissingFileError(f"no demonstrations at {path}: recipes/make_demonstrations.py writes them")
    field = ""
    try:  # zip, zlib and NumPy each have errors of their own for what a damaged file does to them
        with np.load(path, allow_pickle=False) as file:
            arrays = {}
            for field in file.files:
                arrays[field] = file[field]
        if (promised := _members(Path(path))) not in (None, len(arrays)):
            raise ValueError(f"its end says that it has {promised} arrays, its list has {len(arrays)}")
    except Exception as error:
        what = f": field {field}" if field else ""
        raise DemonstrationError(f"{path}{what} cannot be read (truncated or not .npz?): {error}") from error
    return arrays


def _members(path: Path) -> int | None:
    """How many arrays the last bytes of a .npz say that it has; None where they are not what NumPy writes.

    Python's zipfile ends its list of them, without a word, at a damaged entry.
    """
    with path.open("rb") as file:
        file.seek(-END_OF_LIST, 2)
        end = file.read()
    return int.from_bytes(end[10:12], "little") if end.startswith(b"PK\5\6") else None


def _header(path: str | Path, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    try:
        header = json.loads(str(arrays["header"]))
    except (KeyError, json.JSONDecodeError) as error:
        raise DemonstrationError(f"{path}: field header is missing or not JSON") from error
    if not isinstance(header, dict):
        raise DemonstrationError(
            f"{path}: field header is {header!r}, should be a mapping of {_listed(HEADER)}"
        )
    for name in ("format_version", *HEADER):
        if name not in header:
            raise DemonstrationError(f"{path}: field {name} is missing from the header")
    if header["format_version"] != FORMAT_VERSION:
        raise DemonstrationError(
            f"{path}: field format_version is {header['format_version']}; this code reads {FORMAT_VERSION}"
        )
    del header["format_version"]
    if unknown := sorted({*header} - {*HEADER}):
        raise DemonstrationError(
            f"{path}: field header has {_listed(unknown)}; valid: format_version, {_listed(HEADER)}"
        )
    _check_header(path, **header)
    return header


def _check_header(path: str | Path, task: Any, subtask: Any, kind: Any, arguments: Any) -> None:
    if not isinstance(task, str) or not task:
        raise DemonstrationError(
            f"{path}: field task is {task!r}, should be the name of a piece of furniture"
        )
    counted = isinstance(subtask, int) and not isinstance(subtask, bool) and subtask >= 0
    if subtask is not None and not counted:
        raise DemonstrationError(f"{path}: field subtask is {subtask!r}, should be null (all) or 0, 1, ...")
    if kind not in KINDS:
        raise DemonstrationError(f"{path}: field kind is {kind!r}; valid: {_listed(KINDS)}")
    if not isinstance(arguments, dict):
        raise DemonstrationError(
            f"{path}: field arguments is {arguments!r}, should be a mapping of the environment's settings"
        )
    for name, value in (("task", task), ("subtask", subtask)):
        if (found := arguments.get(name, value)) != value:
            raise DemonstrationError(
                f"{path}: field arguments.{name} is {found!r}, but field {name} is {value!r}"
            )


def _check_lengths(path: str | Path, arrays: dict[str, np.ndarray]) -> dict[str, int]:
    """The number of episodes and of rows."""
    for name, (_, _, dtype) in ARRAYS.items():
        if name not in arrays:
            raise DemonstrationError(f"{path}: field {name} is missing")
        if arrays[name].dtype != dtype:
            raise DemonstrationError(f"{path}: field {name} has type {arrays[name].dtype}, should be {dtype}")
    lengths = arrays["lengths"]
    if lengths.ndim != 1 or not len(lengths) or (lengths < 1).any():
        raise DemonstrationError(f"{path}: field lengths must be positive numbers, one an episode")
    return {"episodes": len(lengths), "rows": int(lengths.sum())}


def _check_array(path: str | Path, name: str, array: np.ndarray, sizes: dict[str, int]) -> None:
    size, width, _ = ARRAYS[name]
    if width == 0:
        parts, rest = divmod(array.shape[-1] - observation_size(0), 7) if array.ndim == 2 else (0, 0)
        right = array.shape[:1] == (sizes[size],) and parts > 0 and rest == 0
        wanted = f"({sizes[size]}, {observation_size(0)} + 7 for each part)"
    else:
        shape = (sizes[size],) if width is None else (sizes[size], width)
        right, wanted = array.shape == shape, str(shape)
    if not right:
        raise DemonstrationError(f"{path}: field {name} has shape {array.shape}, should be {wanted}")
    _check_finite(path, name, array)


def _check_snapshots(path: str | Path, arrays: dict[str, np.ndarray], rows: int) -> None:
    for name in SNAPSHOTS:
        if name not in arrays:
            raise DemonstrationError(f"{path}: field {name} is missing")
    for name, array in arrays.items():
        if not name.startswith("snapshot/"):
            continue
        if array.dtype.kind not in "bif":
            raise DemonstrationError(
                f"{path}: field {name} has type {array.dtype}, should be numbers or flags"
            )
        if array.shape[:1] != (rows,):
            raise DemonstrationError(f"{path}: field {name} has {array.shape[:1]} rows, should have {rows}")
        _check_finite(path, name, array)


def _check_finite(path: str | Path, name: str, array: np.ndarray) -> None:
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise DemonstrationError(f"{path}: field {name} has values that are not finite")


def _listed(names: Any) -> str:
    return ", ".join(names)
