"""Where a run lies, and which run lies there."""

import json
import math
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from tstar_rl.checks import InvalidValueError, did_you_mean

__all__ = [
    "CHECKPOINTS",
    "FINISHED",
    "RECIPES",
    "SAVED",
    "SKILLS",
    "SKILLS_TOOK",
    "SPENT",
    "UNFINISHED",
    "UNTRAINED",
    "Place",
    "check_says_if_trained",
    "is_inside_a_run",
    "is_untrained",
    "made_by",
    "read_run_path",
    "run_path",
    "same_spent",
    "spent_by",
    "spent_by_skills",
]

UNTRAINED = "no_finetuning"
"""The system of a chain whose skills are as they were trained alone: there is no recipe, and no run, of that name."""

RECIPES = Path(__file__).resolve().parents[2] / "recipes"
"""Of a clone; where the package is installed there is no such folder."""


FINISHED = "finished.json"
"""What a run writes when it ends: its steps and minutes."""

UNFINISHED = "unfinished"
"""An empty file, from when a run begins until it ends: what lies beside it is to be made anew, if nothing goes on."""

SPENT = ("env_steps", "minutes")
"""What a training takes."""

SKILLS_TOOK = "skills_took"
"""What the config.yaml of a chain says of the training of the skills that it began with: `SPENT`."""

SKILLS = "gail_ppo"
"""The system whose skills a chain is made of where nothing else is said."""

SAVED = ("last", "best", "prior")
"""Names under which a run keeps what it has trained; "prior" is SPiRL's."""


CHECKPOINTS = "checkpoints"
"""The folder in which a run keeps what it goes on from."""


class Place(NamedTuple):
    """What `run_path` takes after its root; the subtask is None for a chain and for the whole task."""

    task: str
    system: str
    seed: int
    subtask: int | None


def run_path(root: str | Path, task: str, recipe: str, seed: int, subtask: int | None = None) -> Path:
    """<root>/<task>/<system>/seed<k>[/subtask<i>]."""
    path = Path(root) / task / recipe / f"seed{seed}"
    return path if subtask is None else path / f"subtask{subtask}"


def is_inside_a_run(name: str) -> bool:
    """Whether a run has folders of that name: a system called so would lie in another run, or be taken for it."""
    return name in (*SAVED, CHECKPOINTS) or re.fullmatch(r"(seed|subtask|skill)\d+", name) is not None


def read_run_path(path: Path, root: Path | None = None) -> tuple[Place, Path]:
    """The inverse of `run_path`: the run that a path belongs to, and the rest of the path below the run's folder.

    Args:
        path: relative to the root.
        root: for the message, where all that lies there is to be of runs.

    Raises:
        InvalidValueError: if it is not <task>/<system>/seed<k>[/subtask<i>][/...].
    """
    found = re.fullmatch(r"([^/]+)/(.+?)/seed(\d+)(?:/subtask(\d+))?(?:/(.*))?", path.as_posix())
    if found is None:
        out = "" if root is None else f" in {root}: what is no run belongs elsewhere"
        raise InvalidValueError(f"a run lies at <task>/<system>/seed<k>[/subtask<i>], got {path}{out}")
    task, system, seed, subtask, rest = found.groups()
    return Place(task, system, int(seed), None if subtask is None else int(subtask)), Path(rest or "")


def spent_by(runs: Iterable[Path]) -> dict[str, float]:
    """Environment steps and minutes of runs that have finished, in all; nan where one has not.

    Raises:
        InvalidValueError: if what one has written when it finished is damaged; it is named.
    """
    files = [run / FINISHED for run in runs]
    if not all(file.is_file() for file in files):
        return dict.fromkeys(SPENT, math.nan)
    spent = [_read_spent(file) for file in files]
    return {name: sum(one.get(name, math.nan) for one in spent) for name in SPENT}


def _read_spent(file: Path) -> dict[str, float]:
    try:
        spent = json.loads(file.read_text())
    except ValueError:  # a UnicodeDecodeError is one, and so is JSON's own
        spent = None
    if not isinstance(spent, dict) or not all(isinstance(value, int | float) for value in spent.values()):
        raise InvalidValueError(
            f"{file} is damaged: put it back from a copy, or write {json.dumps(dict.fromkeys(SPENT, 0))} into it, with "
            "the environment steps and minutes that the run took"
        )
    return spent


def spent_by_skills(root: str | Path, task: str, recipe: str, seed: int, links: int) -> dict[str, float]:
    """The same of the runs of the first `links` skills."""
    return spent_by(run_path(root, task, recipe, seed, index) for index in range(links))


def same_spent(one: Mapping[str, float], other: Mapping[str, float]) -> bool:
    """Whether both are of the same training: no two take the same steps and, to a billionth, the same minutes."""
    return all(math.isclose(one.get(name, math.nan), other.get(name, math.nan)) for name in SPENT)


def is_untrained(system: str) -> bool:
    """Whether a system is skills chained as they are: no_finetuning, or no_finetuning_<name> of other skills."""
    return Path(system).name.startswith(UNTRAINED)


def check_says_if_trained(where: str, name: str, recipe: str) -> None:
    """Checks the name of one of several ways to make a chain: it begins with `UNTRAINED` if nothing is trained.

    Args:
        where: it stands, for the message.
        name: of it.
        recipe: that trains it; `UNTRAINED`: none.

    Raises:
        InvalidValueError: if the name says otherwise.
    """
    if recipe == UNTRAINED and not is_untrained(name):
        raise InvalidValueError(f"{where}: {name} trains nothing, so call it {UNTRAINED}...")
    if recipe != UNTRAINED and is_untrained(name):
        raise InvalidValueError(
            f"{where}: {name} is trained by {recipe}, and a name that begins with {UNTRAINED} means skills as they "
            "are: call it otherwise"
        )


def made_by(path: str | Path) -> str:
    """What a message says of a run's missing file: what makes it; nothing if the path is of no run.

    That is the recipe that writes it, or the one that has begun to; and for a whole task of which only subtasks are
    there, those.
    """
    found = re.search(r"(.*/)?([^/]+)/([^/]+)/seed(\d+)(?:/subtask(\d+))?(?:/|$)", Path(path).as_posix())
    if found is None:
        return ""
    root, task, system, seed, subtask = found.groups()
    folders = Path(root or "").parts
    for place in reversed(range(len(folders))):  # a system may be of two folders: table_lack/wide/gail_ppo
        if (RECIPES.parent / "configs/task" / f"{folders[place]}.yaml").is_file():
            system = "/".join((*folders[place + 1 :], task, system))
            root, task = str(Path(*folders[:place])), folders[place]
            break
    part = "" if subtask is None else f" subtask={subtask}"
    run = run_path(root or ".", task, system, int(seed), None if subtask is None else int(subtask))
    if (run / UNFINISHED).is_file():
        return f": its run, {run}, has not ended; the command that began it goes on with it"
    chained = run_path(root or ".", task, system, int(seed)) / f"last/skill{subtask}"
    if chained.is_dir():
        return f": that skill of the chain is path={chained}"
    there = sorted(run_path(root or ".", task, system, int(seed)).glob("subtask*"))
    if subtask is None and there:
        numbers = ", ".join(path.name.removeprefix("subtask") for path in there)
        return f"; there are runs of subtask={numbers}, which system={UNTRAINED} skills={system} chains"
    if (RECIPES / f"{system}.py").is_file():
        command = f"python recipes/{system}.py task={task}{part} seed={seed}"
        return f": train it first ({command}, with the scale and the folders given here)"
    known = {path.stem for path in RECIPES.glob("*.py")}
    known |= {path.name for path in Path(root or ".", task).glob("*") if path.is_dir()}
    named_after = any(
        Path(system).name.startswith(name) for name in known
    )  # as tstar_costliest is after tstar
    hint = "" if named_after else did_you_mean(system, sorted(known))
    return f": train system={system} of task={task}{part} seed={seed} first{hint}"
