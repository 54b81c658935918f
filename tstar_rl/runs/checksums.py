"""A seal on a folder: the list of its files with the SHA-256 of each, so that no other content is ever read from it."""

import hashlib
import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from tstar_rl.checks import UserError

__all__ = ["LITTER", "SEAL", "DamagedCheckpointError", "read_seal", "seal", "verify"]

SEAL = "checksums.json"
LITTER = r"\.DS_Store|\._.*|\.nfs.*"
"""What file systems leave in folders: no part of what is sealed."""
SHOWN = 3
"""Damaged files that a message names before it counts the others."""


class DamagedCheckpointError(UserError, ValueError):
    """A file of a checkpoint is missing, changed, cut short, or not the checkpoint's; the message names it."""


def seal(folder: Path) -> None:
    """Writes `checksums.json`: the size and SHA-256 of every file below `folder`, and the SHA-256 of that list."""
    files = {name: _describe(folder / name) for name in _files_in(folder)}
    (folder / SEAL).write_bytes(_content(files))


def read_seal(folder: Path) -> dict[str, dict[str, Any]]:
    """The list of files in `checksums.json`, by their paths below `folder`.

    Raises:
        DamagedCheckpointError: if it is missing or is not as it was written.
    """
    try:
        content = (folder / SEAL).read_bytes()
        files = json.loads(content)["files"]
        whole = content == _content(files)
    except FileNotFoundError:
        raise _damaged(folder, [f"{SEAL} is missing (those of older versions have none)"]) from None
    except (ValueError, KeyError, TypeError):
        whole, files = False, {}
    if not whole:
        raise _damaged(folder, [f"{SEAL} is not as it was written"])
    return files


def verify(folder: Path, only: Iterable[str] | None = None) -> dict[str, dict[str, Any]]:
    """Compares every file with the seal, or those in `only`; returns the seal.

    Raises:
        DamagedCheckpointError: for files that are missing, changed, cut short or not in the list.
    """
    files = read_seal(folder)
    there = set(_files_in(folder))
    names = set(files) | there if only is None else set(only)
    wrong = [said for name in sorted(names) if (said := _compare(folder, name, files.get(name), there))]
    if wrong:
        raise _damaged(folder, wrong)
    return files


def _compare(folder: Path, name: str, sealed: dict[str, Any] | None, there: set[str]) -> str | None:
    """What is wrong with a file; None if nothing is."""
    if sealed is None:
        return f"{name} is not in {SEAL}"
    if name not in there:
        return f"{name} is missing"
    found = _describe(folder / name)
    if found["bytes"] != sealed["bytes"]:
        return f"{name} has {found['bytes']} bytes, {SEAL} says {sealed['bytes']}"
    return None if found == sealed else f"{name} is not the file that {SEAL} describes"


def _files_in(folder: Path) -> list[str]:
    """All but the seal and what a file system has left there."""
    found = (path for path in folder.rglob("*") if path.is_symlink() or not path.is_dir())
    named = (path.relative_to(folder).as_posix() for path in found if not re.fullmatch(LITTER, path.name))
    return sorted(name for name in named if name != SEAL)


def _describe(path: Path) -> dict[str, Any]:
    with path.open("rb") as file:
        return {"sha256": hashlib.file_digest(file, "sha256").hexdigest(), "bytes": path.stat().st_size}


def _content(files: dict[str, Any]) -> bytes:
    """The text of `checksums.json`."""
    digest = hashlib.sha256(json.dumps(files, sort_keys=True).encode()).hexdigest()
    return (json.dumps({"files": files, "sha256": digest}, indent=1) + "\n").encode()


def _damaged(folder: Path, wrong: list[str]) -> DamagedCheckpointError:
    more = f" and {len(wrong) - SHOWN} more" if len(wrong) > SHOWN else ""
    return DamagedCheckpointError(
        f"{folder} is damaged: {'; '.join(wrong[:SHOWN])}{more}. "
        "Put it back from a copy, or delete it and run what made it again"
    )
