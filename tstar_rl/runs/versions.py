"""What a run's figures came from: versions of Python and of packages, and the commit of the code."""

import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

__all__ = ["DIRTY", "UNKNOWN", "commit", "versions"]

CODE = ("*.py", "configs", "envs", "pyproject.toml")
"""What decides a run's figures, from the repository's root: a change there is recorded."""
UNKNOWN = "unknown"
"""The commit where there is no git, or no clone."""
DIRTY = "-dirty"
"""Ends the commit of code that differs from it."""


def versions() -> dict[str, str]:
    """Of Python, of the packages that decide a run's figures, and `commit`; `UNKNOWN` where there is none."""
    names = ("torch", "torchrl", "tensordict", "mujoco", "tstar-rl")
    found: dict[str, str] = {"python": sys.version.split()[0]}
    for name in names:
        try:
            found[name] = version(name)
        except ModuleNotFoundError:
            found[name] = "not installed"
    return {**found, "commit": commit() or UNKNOWN}


def commit() -> str:
    """Of the repository that this file is tracked in, `DIRTY` at its end if code or configs differ from it.

    Empty without git, or where the package is installed and no clone, also if it lies below another repository.
    """
    root, here = Path(__file__).parents[2], Path(__file__).name
    try:
        tracked = _git(Path(__file__).parent, "ls-files", "--error-unmatch", here)
        head = _git(root, "rev-parse", "HEAD") if tracked else ""
        dirty = head and _git(root, "status", "--porcelain", "--", *CODE)
    except FileNotFoundError:
        return ""
    return f"{head}{DIRTY}" if dirty else head


def _git(folder: Path, *command: str) -> str:
    done = subprocess.run(["git", "-C", str(folder), *command], capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else ""
