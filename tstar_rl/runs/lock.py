"""One process for each run: the second that starts in the same folder is stopped before it touches anything."""

import errno
import fcntl
import os
import socket
from pathlib import Path

from tstar_rl.checks import UserError

__all__ = ["RunInUseError", "hold", "release"]

NAME = "lock"
_HELD: dict[tuple[int, Path], int] = {}
"""The open lock file of each folder, and of which process: a fork inherits this, and no lock.

Closing any handle of the file would give its lock away."""


class RunInUseError(UserError, RuntimeError):
    """Another process runs in this folder."""


def hold(folder: Path) -> None:
    """Takes a run's folder for this process, until `release` or the process's end, however it ends.

    Taking it again in the same process does nothing. The lock is the system's (POSIX): child processes do not inherit
    it, and none is left behind by a process that was killed. The file, which says who holds it, stays.

    Raises:
        RunInUseError: if another process holds it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    place = folder.resolve() / NAME
    if (os.getpid(), place) in _HELD:
        return
    handle = os.open(place, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        fcntl.lockf(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        holder = os.read(handle, 200).decode(errors="replace").strip()
        os.close(handle)
        if error.errno not in (errno.EAGAIN, errno.EACCES):
            return  # a network's file system without locks: as before there were any
        raise RunInUseError(
            f"{folder} is in use by {holder or 'another process'}: wait until it ends, "
            "or give this run a place of its own (runs_dir=... results_dir=...) or another seed"
        ) from None
    _HELD[os.getpid(), place] = handle
    os.ftruncate(handle, 0)
    os.write(handle, f"process {os.getpid()} on {socket.gethostname()}\n".encode())


def release(folder: Path) -> None:
    """Gives the folder back."""
    handle = _HELD.pop((os.getpid(), folder.resolve() / NAME), None)
    if handle is not None:
        os.close(handle)
