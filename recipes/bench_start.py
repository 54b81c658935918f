"""The part of the bench that waits: what a user does before the first answer and before the first rollout."""

import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

from tstar_rl.launch.side_by_side import RECIPES, run_recipe

TIMES = 3


def start_rows(given: Sequence[str]) -> Iterator[dict[str, Any]]:
    """Seconds from the command to its end, each the median of `TIMES` processes.

    `help_seconds` is `gail_ppo.py --help`; `mistake_seconds` a value that is not valid; `first_rollout_seconds` a
    training of no steps and without a warm start: all that comes before the first rollout.

    Args:
        given: values for `gail_ppo.py` that were given on the command line.
    """
    with TemporaryDirectory() as folder:
        places = [f"{name}_dir={folder}/{name}" for name in ("results", "runs", "demonstrations")]
        own = [*given, *places, "subtask=0", "progress_bar=false"]
        run_recipe(("make_demonstrations", *own, "kinds=[plain,noisy]"))
        commands = {
            "help_seconds": ["--help"],
            "mistake_seconds": ["seed=-1"],
            "first_rollout_seconds": [*own, "resume=false", "training.total_steps=0", "warm_start=false"],
        }
        for name, values in commands.items():
            seconds = median(_seconds(values, name == "mistake_seconds") for _ in range(TIMES))
            yield {"measure": name, "value": round(seconds, 2), "unit": "s"}


def _seconds(values: Sequence[str], fails: bool) -> float:
    """How long gail_ppo.py takes.

    Raises:
        RuntimeError: it ended otherwise than it should.
    """
    command = [sys.executable, str(Path(RECIPES) / "gail_ppo.py"), *values]
    began = time.perf_counter()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    spent = time.perf_counter() - began
    if bool(done.returncode) != fails:
        raise RuntimeError(f"{' '.join(command)} ended with {done.returncode}: {done.stderr[-500:]}")
    return spent
