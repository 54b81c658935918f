"""Steps within a time limit: what is stopped when it is over goes on when the same command is given again."""

import math
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path

from tstar_rl.checks import InvalidValueError
from tstar_rl.launch.side_by_side import Step, run_recipe

__all__ = ["MORE", "TimeIsOver", "check_goes_on", "deadline", "run_until"]

MORE = 75
"""The exit code (EX_TEMPFAIL) of a command that is to be given again."""


class TimeIsOver(SystemExit):
    """A step is not done, and there is no time left for it."""

    def __init__(self) -> None:
        super().__init__("the time is over")


def check_goes_on(resume: bool, name: str) -> None:
    """Refuses `resume=false` where one call goes on with what the call before left.

    Raises:
        InvalidValueError: for the recipe `name`.
    """
    if not resume:
        raise InvalidValueError(
            f"{name} with a time limit goes on from call to call, so resume must be true, got false: delete its "
            "folders to start over"
        )


def deadline(minutes: float | None) -> float:
    """When so many minutes are over, in seconds of the monotonic clock; None: never."""
    return math.inf if minutes is None else time.monotonic() + 60 * minutes


def run_until(
    end: float, step: Step, shared: Sequence[str] = (), line: int = 0, code: Path | None = None
) -> None:
    """Runs a step as `run_recipe` does.

    Raises:
        TimeIsOver: if it is not done at `end`, in seconds of the monotonic clock; it is killed then.
        SystemExit: if it fails.
    """
    left = end - time.monotonic()
    if left <= 0:
        raise TimeIsOver
    try:
        run_recipe(step, shared, line, None if math.isinf(left) else left, code)
    except subprocess.TimeoutExpired:
        raise TimeIsOver from None
