"""What a run's figures came from: versions of Python and of packages, the processor, and the commit of the code."""

import hashlib
import platform
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

__all__ = ["DIRTY", "UNKNOWN", "commit", "own_script", "processor", "versions"]

CODE = ("*.py", "configs", "envs", "pyproject.toml")
"""What decides a run's figures, from the repository's root: a change there is recorded."""
UNKNOWN = "unknown"
"""The commit where there is no git, or no clone."""
DIRTY = "-dirty"
"""Ends the commit of code that differs from it."""


def versions() -> dict[str, str]:
    """Of Python and of the packages that decide a run's figures, `processor()`, and `commit()` or `UNKNOWN`."""
    names = ("torch", "torchrl", "tensordict", "mujoco", "tstar-rl")
    found: dict[str, str] = {"python": sys.version.split()[0]}
    for name in names:
        try:
            found[name] = version(name)
        except ModuleNotFoundError:
            found[name] = "not installed"
    return {**found, "processor": processor(), "commit": commit() or UNKNOWN}


def processor(cpuinfo: Path = Path("/proc/cpuinfo")) -> str:
    """What decides the last bits of a figure (decision 0025): machine, vendor, family.model, torch's choice of code.

    Vendor, family and model are those of Linux; elsewhere they are left out.
    """
    import torch

    lines = cpuinfo.read_text().splitlines() if cpuinfo.is_file() else []
    known = {
        name.strip(): value.strip() for name, _, value in (line.partition(":") for line in reversed(lines))
    }
    kind = ".".join(known[name] for name in ("cpu family", "model") if name in known)
    words = (platform.machine(), known.get("vendor_id", ""), kind, torch.backends.cpu.get_cpu_capability())
    return " ".join(word for word in words if word)


def commit() -> str:
    """Of the repository that this file is tracked in, `DIRTY` at its end if code or configs differ from it.

    Empty without git, where git fails, or where the package is installed and no clone, also if it lies below another
    repository.
    """
    root, here = Path(__file__).parents[2], Path(__file__).name
    try:
        _git(Path(__file__).parent, "ls-files", "--error-unmatch", here)
        head, changed = _git(root, "rev-parse", "HEAD"), _git(root, "status", "--porcelain", "--", *CODE)
    except (FileNotFoundError, subprocess.CalledProcessError):
        return ""
    return f"{head}{DIRTY}" if changed else head


def own_script() -> str | None:
    """The program that runs, with the first digits of its SHA-256, where it lies outside of the clone.

    `commit` says nothing of it then. None: it lies inside, or there is no file of it.
    """
    name = getattr(sys.modules["__main__"], "__file__", None)
    if name is None or not (file := Path(name).resolve()).is_file():
        return None
    if file.is_relative_to(Path(__file__).resolve().parents[2]):
        return None
    return f"{file.name} sha256:{hashlib.sha256(file.read_bytes()).hexdigest()[:16]}"


def _git(folder: Path, *command: str) -> str:
    done = subprocess.run(
        ["git", "--no-optional-locks", "-C", str(folder), *command],
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()
