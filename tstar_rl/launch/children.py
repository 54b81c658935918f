"""Processes and tasks that this one starts, and that end when it is told to end, by Ctrl-C or by `kill`."""

import signal
import subprocess
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import NoReturn

__all__ = ["child", "end_children", "ended_by_kill", "run_child"]

GRACE = 5.0
"""Seconds that a process has to end those that it has started itself, once it is told to end."""

_ends: set[Callable[[], object]] = set()
"""What ends each of those that are running."""


def run_child(command: Sequence[str], environ: Mapping[str, str], seconds: float | None = None) -> int:
    """Runs a command to its end.

    Args:
        command: and its arguments.
        environ: its environment.
        seconds: that it may take; None: as long as it does.

    Returns:
        Its exit code; that of a signal is negative.

    Raises:
        TimeoutExpired: if it was not done in `seconds`; it is ended then, as it is by whatever else ends the wait: told
            to end, and killed where it has not after some seconds.
    """
    with ended_by_kill(), subprocess.Popen(command, env=environ) as process, child(process.terminate):
        try:
            return process.wait(seconds)
        except BaseException:
            _end(process)
            raise


def _end(process: subprocess.Popen[bytes]) -> None:
    process.terminate()
    try:
        with suppress(subprocess.TimeoutExpired):
            process.wait(GRACE)
    finally:
        process.kill()  # nothing happens to one that has ended


@contextmanager
def child(end: Callable[[], object]) -> Iterator[None]:
    """Within it something runs that `end` ends; whoever waits for it then sees that it has."""
    _ends.add(end)
    try:
        yield
    finally:
        _ends.discard(end)


def end_children() -> None:
    """Ends what other threads are waiting for within `child`."""
    for end in list(_ends):
        end()


@contextmanager
def ended_by_kill() -> Iterator[None]:
    """Within it SIGTERM raises SystemExit, in the main thread, so that children can be ended first.

    A process that dies of the signal leaves them running. In another thread it does nothing: Python hands signals to
    the main one.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(number: int, _frame: object) -> NoReturn:
        raise SystemExit(128 + number)

    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
