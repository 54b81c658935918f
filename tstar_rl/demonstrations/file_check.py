"""Reads a file of demonstrations and checks every field of it; an error names file, field and what is valid."""

import functools
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tstar_rl.checks import MissingFileError
from tstar_rl.demonstrations.header import FORMAT_VERSION, HEADER, KINDS, DemonstrationError, read_header

__all__ = [
    "ARRAYS",
    "FORMAT_VERSION",
    "FURNITURE",
    "HEADER",
    "KINDS",
    "NOISE",
    "DemonstrationError",
    "Made",
    "check_arrays",
    "read",
    "read_made",
    "snapshot_layout",
]

ARRAYS: dict[str, tuple[str, int | None, np.dtype]] = {
    "seeds": ("episodes", None, np.dtype(np.int64)),
    "lengths": ("episodes", None, np.dtype(np.int64)),
    "success": ("episodes", None, np.dtype(bool)),
    "observations": ("rows", 0, np.dtype(np.float32)),
    "actions": ("rows", 9, np.dtype(np.float32)),
    "executed": ("rows", 9, np.dtype(np.float32)),
}
"""Length, width (0: that of an observation) and type of each."""
NOISE = "noise"
"""An array () of those files that say with which noise they were made. It is no part of the header, which has to be
what any commit of the library can read: arms of one experiment are run with the code of several."""
FURNITURE = "furniture"
"""Likewise an array () of text, where known: the digest of the furniture's file."""
END_OF_LIST = 22
"""Bytes at the end of a zip file without a comment; bytes 10 and 11 count its members."""


class Made(NamedTuple):
    """What a file says of how it was made: its header, number of episodes, and noise and furniture where it does."""

    header: dict[str, Any]
    episodes: int
    noise: float | None
    furniture: str | None


def read(path: str | Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The header (`HEADER`) and all arrays of a file, checked.

    Raises:
        MissingFileError: if there is no file; a FileNotFoundError.
        DemonstrationError: names the field that is wrong.
    """
    arrays = _arrays(path)
    header = read_header(path, arrays)
    check_arrays(path, header, arrays)
    return header, arrays


def check_arrays(path: str | Path, header: dict[str, Any], arrays: dict[str, np.ndarray]) -> None:
    """Checks what a file holds, or is to hold.

    Raises:
        DemonstrationError: names the field that is wrong.
    """
    sizes, width = _check_lengths(path, arrays), _width(path, header["task"])
    _noise(path, arrays)
    _digest(path, arrays)
    for name in ARRAYS:
        _check_array(path, name, arrays[name], sizes, width)
    if not arrays["success"].all():
        failed = int(np.flatnonzero(~arrays["success"])[0])
        raise DemonstrationError(f"{path}: field success is False in episode {failed}; all must be successes")
    for name in ("actions", "executed"):
        if (largest := float(np.abs(arrays[name]).max())) > 1:
            raise DemonstrationError(f"{path}: field {name} has {largest:g}; actions are in [-1, 1]")
    _check_snapshots(path, arrays, sizes["rows"], header["task"])


def read_made(path: str | Path) -> Made:
    """How a file was made, without what is learned from; raises what `read` does."""
    arrays = _arrays(path, ("header", "lengths", NOISE, FURNITURE))
    header = read_header(path, arrays)
    if "lengths" not in arrays:
        raise DemonstrationError(f"{path}: field lengths is missing")
    return Made(header, arrays["lengths"].size, _noise(path, arrays), _digest(path, arrays))


def _arrays(path: str | Path, only: tuple[str, ...] | None = None) -> dict[str, np.ndarray]:
    """The arrays of a file, or those of them that `only` names."""
    if not Path(path).is_file():
        raise MissingFileError(f"no demonstrations at {path}: recipes/make_demonstrations.py writes them")
    field = ""
    try:  # zip, zlib and NumPy each have errors of their own for what a damaged file does to them
        with np.load(path, allow_pickle=False) as file:
            arrays = {}
            for field in file.files:
                if only is None or field in only:
                    arrays[field] = file[field]
            listed = len(file.files)
        if (promised := _members(Path(path))) not in (None, listed):
            raise ValueError(f"its end says that it has {promised} arrays, its list has {listed}")
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


def _width(path: str | Path, task: str) -> int:
    """Numbers in an observation of the task."""
    from tstar_rl.env.task_tables import observation_dim

    try:
        return observation_dim(task)
    except ValueError as error:
        raise DemonstrationError(f"{path}: field task: {error}") from error


def _noise(path: str | Path, arrays: dict[str, np.ndarray]) -> float | None:
    if NOISE not in arrays:
        return None
    found = arrays[NOISE]
    if found.shape or found.dtype != np.float64 or not np.isfinite(found) or found < 0:
        raise DemonstrationError(f"{path}: field {NOISE} is {found!r}, should be one float64 from 0")
    return float(found)


def _digest(path: str | Path, arrays: dict[str, np.ndarray]) -> str | None:
    if FURNITURE not in arrays:
        return None
    found = arrays[FURNITURE]
    if found.shape or found.dtype.kind != "U" or not re.fullmatch("[0-9a-f]{64}", str(found)):
        raise DemonstrationError(f"{path}: field {FURNITURE} is {found!r}, should be 64 hexadecimal digits")
    return str(found)


def _check_array(path: str | Path, name: str, array: np.ndarray, sizes: dict[str, int], wide: int) -> None:
    size, width, _ = ARRAYS[name]
    shape = (sizes[size],) if width is None else (sizes[size], width or wide)
    if array.shape != shape:
        parts = f": {wide} numbers in an observation of the task" if width == 0 else ""
        raise DemonstrationError(f"{path}: field {name} has shape {array.shape}, should be {shape}{parts}")
    _check_finite(path, name, array)


def _check_snapshots(path: str | Path, arrays: dict[str, np.ndarray], rows: int, task: str) -> None:
    layout = snapshot_layout(task)
    for name in layout:
        if name not in arrays:
            raise DemonstrationError(f"{path}: field {name} is missing")
    for name, array in arrays.items():
        if not name.startswith("snapshot/"):
            continue
        if name not in layout:
            raise DemonstrationError(f"{path}: field {name} is unknown; valid: {', '.join(layout)}")
        shape, dtype = layout[name]
        if array.dtype != dtype:
            raise DemonstrationError(f"{path}: field {name} has type {array.dtype}, should be {dtype}")
        if array.shape != (rows, *shape):
            raise DemonstrationError(
                f"{path}: field {name} has shape {array.shape}, should be {(rows, *shape)}"
            )
        _check_finite(path, name, array)


@functools.cache
def snapshot_layout(task: str) -> dict[str, tuple[tuple[int, ...], np.dtype]]:
    """What a snapshot of the task has: by the name of the array, the shape of one row, and the type."""
    from tstar_rl.env.furniture_env import FurnitureEnv

    env = FurnitureEnv(task, nthread=1)
    try:
        entries = env.snapshot().flatten_keys("/").items()
        return {f"snapshot/{name}": (tuple(value.shape[1:]), value.numpy().dtype) for name, value in entries}
    finally:
        env.close()


def _check_finite(path: str | Path, name: str, array: np.ndarray) -> None:
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise DemonstrationError(f"{path}: field {name} has values that are not finite")
