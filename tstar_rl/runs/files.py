"""Files that are written at once: whoever is killed, or finds the disk full, leaves the old content or the new one."""

import errno
import fcntl
import io
import os
import re
import shutil
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

__all__ = [
    "append_text", "flush", "named_in_errors", "put_back", "remove_folder", "remove_remains", "replace_folder",
    "replacing", "replacing_folder", "turn_to_write",
]  # fmt: skip


@contextmanager
def named_in_errors(path: Path) -> Iterator[None]:
    """Adds the path to an `OSError` that names no file, and makes one of what torch says of a full disk."""
    try:
        yield
    except OSError as error:
        if error.filename is None and error.errno is not None:
            error.filename = str(path)
        raise
    except RuntimeError as error:  # torch's own, of a file that it maps
        full = os.strerror(errno.ENOSPC)
        if full not in str(error):
            raise
        raise OSError(errno.ENOSPC, full, str(path)) from error


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Gives a path to write to: what is there when the block ends replaces `path`. If the block fails, nothing does."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".partial")
    try:
        with named_in_errors(path):
            yield partial
            os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


@contextmanager
def replacing_folder(path: Path) -> Iterator[Path]:
    """Gives a folder to make: what is in it when the block ends replaces `path`. If the block fails, nothing does.

    It is on the disk before it takes its place, and before the caller removes what it makes needless: a machine that
    loses its power has one or the other. What a kill has left beside `path` is put back first: see `put_back`.
    """
    put_back(path)
    remove_remains(path)
    stage = path.with_name(f".{path.name}.new-{uuid.uuid4().hex}")
    try:
        yield stage
        flush(stage, *stage.rglob("*"))
        replace_folder(stage, path)
        flush(path.parent)
    finally:
        shutil.rmtree(stage, ignore_errors=True)


def flush(*paths: Path) -> None:
    """Has the system write files, and names in folders, to the disk; not every file system can be asked."""
    for path in paths:
        handle = os.open(path, os.O_RDONLY)
        try:
            with suppress(OSError):
                os.fsync(handle)
        finally:
            os.close(handle)


def remove_remains(path: Path) -> None:
    """Removes what processes that were killed while they replaced a folder have left beside it."""
    for left in path.parent.glob(f".*{path.name}*"):
        if re.fullmatch(rf"\.+{re.escape(path.name)}(-\d+)?(\.[a-z]+-[0-9a-f]{{32}})+", left.name):
            shutil.rmtree(left, ignore_errors=True)


def replace_folder(stage: Path, destination: Path) -> None:
    """Puts a complete folder in its place; what was there stays until then, if a kill comes in between beside it."""
    before = destination.with_name(f".{destination.name}.old-{uuid.uuid4().hex}")
    if destination.exists():
        os.replace(destination, before)
    try:
        os.replace(stage, destination)
    except OSError:
        if before.exists():
            os.replace(before, destination)
        raise
    shutil.rmtree(before, ignore_errors=True)


def remove_folder(path: Path) -> None:
    """Removes a folder; whoever is killed meanwhile leaves no part of it under its name."""
    if path.is_dir():
        remove_remains(path)
        os.replace(path, left := path.with_name(f".{path.name}.removed-{uuid.uuid4().hex}"))
        shutil.rmtree(left, ignore_errors=True)


def put_back(destination: Path) -> None:
    """Puts back a folder that had been moved aside for a new one, where a kill came before that took its place."""
    if not destination.exists():
        for left in destination.parent.glob(f".{destination.name}.old-*"):
            os.replace(left, destination)
            return


def append_text(path: Path, text: str) -> None:
    """Adds text to the end of a file; if not all of it can be written, the file stays as it was.

    Raises:
        OSError: if the disk is full or the folder read-only.
    """
    with named_in_errors(path), _open_at_end(path) as file:
        size = file.tell()
        try:
            rest = memoryview(text.encode())
            while rest:  # a disk that is nearly full takes the first part of a write
                rest = rest[file.write(rest) :]
        except BaseException:
            file.truncate(size)
            raise


def _open_at_end(path: Path) -> io.FileIO:
    return path.open("ab", buffering=0)


@contextmanager
def turn_to_write(folder: Path) -> Iterator[None]:
    """Lets one process at a time through for a folder; the others wait. For a short read, change and write.

    Not every network file system has locks. Where there are none, of two that write a file at the same moment one may
    lose what it wrote, or end with an error.
    """
    folder.mkdir(parents=True, exist_ok=True)
    handle = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
