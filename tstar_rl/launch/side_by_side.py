"""Recipes run as processes of their own, some at a time, here or wherever a launcher takes them."""

import os
import shlex
import sys
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from hydra.errors import HydraException
from omegaconf.errors import OmegaConfBaseException

from tstar_rl.checks import UserError
from tstar_rl.config.command_line import of_the_disk
from tstar_rl.launch.children import end_children, ended_by_kill, run_child
from tstar_rl.launch.code_of_commit import environ_of
from tstar_rl.launch.overrides import config_folders
from tstar_rl.runs.run_folder import RECIPES

__all__ = ["Step", "run_recipe", "run_side_by_side"]

Step = tuple[str, ...]
"""A recipe and its values."""


def run_recipe(
    step: Step,
    shared: Sequence[str] = (),
    line: int = 0,
    seconds: float | None = None,
    code: Path | None = None,
) -> None:
    """Runs one recipe, with the values `shared` before its own; its progress bar takes the screen's line `line`.

    Args:
        step: recipe and values.
        shared: values that come before the step's own.
        line: of the screen.
        seconds: that it may take; None: as long as it does.
        code: the checkout whose recipe and library are run, in this folder; None: this one's.

    Raises:
        SystemExit: if it fails, with its command.
        TimeoutExpired: if it was not done in `seconds`; it is killed then.
    """
    name, *values = step
    found = os.environ if code is None else environ_of(code)
    environ = {**found, "TQDM_POSITION": str(line), "TQDM_MININTERVAL": "1", "OMP_NUM_THREADS": "1"}
    recipes = RECIPES if code is None else code / "recipes"
    command = [sys.executable, str(recipes / f"{name}.py"), *config_folders(), *shared, *values]
    if run_child(command, environ, seconds):
        raise SystemExit(f"this step failed: {shlex.join(command)}")


def run_side_by_side(
    lanes: Sequence[Sequence[Any]],
    shared: Sequence[str],
    processes: int,
    run: Callable[..., None] | None = None,
) -> None:
    """Runs each lane's steps one after another, and up to `processes` lanes at once.

    A step that fails ends its lane; the other lanes go on. Ctrl-C and SIGTERM end all of them, and what they run.

    Args:
        lanes: that do not wait for each other, of `Step`, or of whatever `run` takes.
        shared: values that every step is given.
        processes: lanes at once.
        run: of a step, the shared values and the lane's line on the screen, from `backends.launcher`; None:
            `run_recipe`.

    Raises:
        SystemExit: at the end, if a step has failed, with the commands that did; at SIGTERM.
        KeyboardInterrupt: at Ctrl-C.
    """
    stopped = threading.Event()
    lines: SimpleQueue[int] = SimpleQueue()
    for line in range(processes):
        lines.put(line)

    def follow(lane: int) -> str | None:
        line = lines.get()
        try:
            for step in lanes[lane]:
                if not stopped.is_set():
                    (run or run_recipe)(step, shared, line)
        except (SystemExit, UserError, HydraException, OmegaConfBaseException) as failure:
            return str(failure) or repr(failure)
        except OSError as failure:
            return of_the_disk(failure)
        except Exception as failure:  # of the program: the other lanes' hours are not lost to it
            return "".join(traceback.format_exception(failure))
        finally:
            lines.put(line)
        return None

    with ended_by_kill(), ThreadPoolExecutor(processes) as pool:
        running = [pool.submit(follow, lane) for lane in range(len(lanes))]
        try:
            failures = [failure for lane in running if (failure := lane.result()) is not None]
        except BaseException:
            stopped.set()
            while not all(lane.done() for lane in running):
                end_children()
                time.sleep(0.1)
            raise
    if failures:
        raise SystemExit("\n".join(failures))
