"""The code of another commit: arms of an experiment that was begun with it are run with it, however old it is."""

import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hydra import initialize_config_dir
from hydra.core.global_hydra import GlobalHydra

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.values import CONFIGS
from tstar_rl.runs.files import turn_to_write

__all__ = ["code_of_commit", "configs_of", "environ_of"]


def code_of_commit(commit: str, folder: Path, repository: Path = CONFIGS.parent) -> Path:
    """A checkout of that commit below `folder`; it is made (`git worktree add`) unless it is there.

    Args:
        commit: a hash, a part of one, or the name of a branch or a tag.
        folder: where checkouts lie, each in a folder called by its hash.
        repository: which has the commit.

    Raises:
        InvalidValueError: if the repository does not have the commit, or the checkout that is there is of another one
            or was changed.
    """
    commit = _hash_of(commit, repository)
    place = folder.resolve() / commit[:12]
    with turn_to_write(place.parent):  # another process may be making it
        if not place.is_dir():
            _check_out(commit, place, repository)
    head, changed = _git(place, "rev-parse", "HEAD"), _git(place, "status", "--porcelain")
    if head != commit or changed:
        found = f"is of {head}" if not changed else f"was changed: {' '.join(changed.split())}"
        raise InvalidValueError(
            f"{place} is to be the code of {commit}, but it {found}; delete it and it is made anew"
        )
    return place


@contextmanager
def configs_of(root: Path) -> Iterator[None]:
    """Meanwhile Hydra composes from the configs of another checkout; those of this one have other values by now."""
    ours = GlobalHydra.instance().hydra
    GlobalHydra.instance().clear()
    try:
        with initialize_config_dir(str(root / "configs"), version_base="1.3"):
            yield
    finally:
        GlobalHydra.instance().hydra = ours


def environ_of(root: Path) -> dict[str, str]:
    """The environment in which Python finds a checkout's code before any that is installed."""
    theirs = os.environ.get("PYTHONPATH")  # where modules of a user's own may lie
    found = (str(root), str(root / "envs"), *([theirs] if theirs else []))
    return {**os.environ, "PYTHONPATH": os.pathsep.join(found)}


def _check_out(commit: str, place: Path, repository: Path) -> None:
    """Makes a checkout beside its place and moves it there once it is whole: one that a kill cut off is begun anew.

    Twice --force: git locks a worktree while it makes it, and one that was cut off, or deleted by hand, is still known.
    """
    stage = place.with_name(f"{place.name}.making")
    shutil.rmtree(stage, ignore_errors=True)
    _git(repository, "worktree", "add", "--force", "--force", "--detach", str(stage), commit)
    _git(repository, "worktree", "move", "--force", "--force", str(stage), str(place))


def _hash_of(commit: str, repository: Path) -> str:
    """The whole hash of what git calls `commit`: a branch or an upper-case hash is no name of a checkout's HEAD."""
    _git(repository, "rev-parse", "--git-dir")
    try:
        return _git(repository, "rev-parse", "--verify", "--end-of-options", f"{commit}^{{commit}}")
    except InvalidValueError as error:
        raise InvalidValueError(
            f"commit {commit} is not in the repository {repository}: fetch it, or name a commit, branch or tag of it"
        ) from error


def _git(folder: Path, *command: str) -> str:
    """What git prints; InvalidValueError with its words if it refuses, or if there is no git."""
    if shutil.which("git") is None:
        raise InvalidValueError(f"git is not installed here: it checks out the code of a commit of {folder}")
    done = subprocess.run(["git", "-C", str(folder), *command], capture_output=True, text=True, check=False)
    if done.returncode:
        raise InvalidValueError(f"git {' '.join(command)} in {folder}: {done.stderr.strip()}")
    return done.stdout.strip()
