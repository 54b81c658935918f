"""What was saved held against what is asked for. Loads no torch, so that what starts recipes can ask, too."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tstar_rl.checks import UserError

__all__ = [
    "CHAINING",
    "DEMONSTRATIONS_READ",
    "FURNITURE",
    "MACHINE_ONLY",
    "NOT_CLONED",
    "CheckpointMismatchError",
    "as_begun",
    "check_config",
    "differences",
    "known_then",
]

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
CHAINING = ("chain", "terminal_reward", "d_omega", "skills")
"""Sections that a recipe which trains one policy does not read, but for chain.capacity: a chain of its skills compares
that."""
NOT_CLONED = (*CHAINING, "training")
"""Sections that behaviour cloning does not read."""


DEMONSTRATIONS_READ = "demonstrations_read"
"""What a run's config.yaml says of a user's file of demonstrations: the SHA-256 of each part that was read."""


FURNITURE = "furniture"
"""What config.yaml and checkpoints say of the task's file of furniture: `env.task_tables.furniture_digest`."""


class CheckpointMismatchError(UserError, ValueError):
    """A checkpoint belongs to something else."""


def check_config(results: Path, saved: Mapping[str, Any], asked: Mapping[str, Any]) -> None:
    """Raises CheckpointMismatchError if the run whose tables lie at `results` had other values than are asked for.

    What was not saved is not compared.
    """
    wanted = {name: value for name, value in asked.items() if name in saved}
    if wrong := differences({name: saved[name] for name in wanted}, wanted):
        raise CheckpointMismatchError(
            f"{results}: {'; '.join(wrong)} "
            "(resume=false starts over; results_dir=... and runs_dir=... keep runs apart)"
        )


def known_then(saved: Mapping[str, Any], asked: Mapping[str, Any]) -> dict[str, Any]:
    """`asked` as the run in `saved` would have noted it.

    Older runs, and programs of a user's own, note no recipe and no furniture, and older ones no user's file. Older ones
    of SPiRL note normalizer.running as their scale has it, and did not read it.
    """
    told = ("recipe", DEMONSTRATIONS_READ, FURNITURE)
    known = {name: value for name, value in asked.items() if name not in told or name in saved}
    running = (saved.get("normalizer") or {}).get("running")
    if asked.get("recipe") == "spirl" and "normalizer" in asked and running is not None:
        known["normalizer"] = {**asked["normalizer"], "running": running}
    return known


def as_begun(saved: Mapping[str, Any], asked: Mapping[str, Any]) -> dict[str, Any]:
    """`asked`, but with the fewer steps that the training in `saved` was given, if it may go on from them.

    A training of one policy may, unless something in it follows the share of its steps that is done: rates that fall
    in a line, or a fixed deviation that exploration lowers (nothing in SPiRL does). Then it makes the same numbers as
    one that was given all the steps at once. Not so a recipe of a user's own that reads `training.progress` for more
    than that: it goes on, with what it made of the progress until then.
    """
    section = "spirl" if "spirl" in asked else "training"
    fixed = asked.get("exploration") is not None and asked.get("networks", {}).get("std") == "fixed"
    scheduled = section == "training" and (
        fixed or ("ppo" in asked and asked["ppo"].get("linear_decay", True))
    )
    now, before = (values.get(section, {}).get("total_steps", 0) for values in (asked, saved))
    if scheduled or "from_checkpoint" in asked or not 0 < before < now:
        return dict(asked)
    return {**asked, section: {**asked[section], "total_steps": before}}


def differences(saved: Any, wanted: Any, name: str = "") -> list[str]:
    """Readable differences of two nested plain values."""
    if isinstance(saved, Mapping) and isinstance(wanted, Mapping):
        return [
            text
            for key in sorted({*saved, *wanted}, key=str)
            for text in differences(saved.get(key), wanted.get(key), f"{name}.{key}" if name else str(key))
        ]
    saved, wanted = (list(value) if isinstance(value, tuple) else value for value in (saved, wanted))
    if saved == wanted:
        return []
    if name == FURNITURE:
        return ["the task's file of furniture said something else when it was saved than it does now"]
    return [f"{name} was {saved!r} when it was saved, and is {wanted!r} now"]
