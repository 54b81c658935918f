"""What was saved held against what is asked for. Loads no torch, so that what starts recipes can ask, too."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tstar_rl.checks import UserError

__all__ = ["MACHINE_ONLY", "CheckpointMismatchError", "check_config", "differences"]

MACHINE_ONLY = (
    "nthread",
    "resume",
    "results_dir",
    "runs_dir",
    "demonstrations_dir",
    "launch",
    "cluster",
    "progress_bar",
    "evaluation",
)
"""Config values that do not change what a run computes."""


class CheckpointMismatchError(UserError, ValueError):
    """A checkpoint belongs to something else."""


def check_config(results: Path, saved: Mapping[str, Any], asked: Mapping[str, Any]) -> None:
    """Raises CheckpointMismatchError if the finished run at `results` was saved with other values than are asked for.

    What was not saved is not compared.
    """
    wanted = {name: value for name, value in asked.items() if name in saved}
    if wrong := differences({name: saved[name] for name in wanted}, wanted):
        raise CheckpointMismatchError(f"{results}: {'; '.join(wrong)} (resume=false starts over)")


def differences(saved: Any, wanted: Any, name: str = "") -> list[str]:
    """Readable differences of two nested plain values."""
    if isinstance(saved, Mapping) and isinstance(wanted, Mapping):
        return [
            text
            for key in sorted({*saved, *wanted}, key=str)
            for text in differences(saved.get(key), wanted.get(key), f"{name}.{key}" if name else str(key))
        ]
    saved, wanted = (list(value) if isinstance(value, tuple) else value for value in (saved, wanted))
    return [] if saved == wanted else [f"{name} was {saved!r} when it was saved, and is {wanted!r} now"]
