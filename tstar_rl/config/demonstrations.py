"""Which demonstrations a config's recipe learns from: the library's own, or a user's file."""

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from omegaconf import DictConfig, open_dict

from tstar_rl.checks import InvalidValueError, MissingFileError
from tstar_rl.config.values import plain
from tstar_rl.demonstrations.file_check import read_made
from tstar_rl.demonstrations.header import KINDS, DemonstrationError, unknown_setting
from tstar_rl.runs.mismatch import DEMONSTRATIONS_READ, differences

if TYPE_CHECKING:
    from tstar_rl.demonstrations.data_set import Demonstrations

__all__ = [
    "check_made",
    "demonstrated",
    "demonstrations_path",
    "demonstrations_seed",
    "digests_of_file",
    "given_demonstrations",
    "load_demonstrations",
    "other_settings",
    "part_name",
]

ANY_VALUE = ("max_steps",)
"""Settings that are not compared: an episode that succeeded would have succeeded with any later end."""

AGAIN = ", and so were the skills, chains and tables that came of it (resume=false makes each again)"
"""What follows from another file of furniture, where the demonstrations are the library's own."""


def part_name(subtask: int | None) -> str:
    """What a file of a subtask is called, or one of the whole task."""
    return "whole" if subtask is None else f"subtask{subtask}"


def demonstrations_path(config: DictConfig, subtask: int | None, kind: str) -> Path:
    """<demonstrations_dir>/<task>/seed<k>/<subtask<i>|whole>_<kind>.npz; k is demonstrations.seed, or the run's seed.

    Raises:
        ValueError: if `kind` is not one of `KINDS`.
    """
    if kind not in KINDS:
        raise InvalidValueError(f"kind of demonstrations must be one of {', '.join(KINDS)}; got {kind!r}")
    seed = demonstrations_seed(config)
    folder = Path(config.demonstrations_dir) / config.task.name / f"seed{seed}"
    return folder / f"{part_name(subtask)}_{kind}.npz"


def demonstrations_seed(config: DictConfig) -> int:
    """The seed that the demonstrations were made with: demonstrations.seed, or the run's."""
    return config.seed if config.demonstrations.seed is None else config.demonstrations.seed


def demonstrated(config: DictConfig) -> Sequence[int | None]:
    """The subtasks that recipes/make_demonstrations.py makes demonstrations of; None is the whole task."""
    every = [None] if config.whole else range(config.task.subtasks)
    return every if config.subtask is None else [config.subtask]


def load_demonstrations(config: DictConfig, subtask: int | None) -> "Demonstrations":
    """Those that the config's recipe learns from: of demonstrations.file, or made by recipes/make_demonstrations.py.

    They must have been made in the config's world: every setting of the environment is compared, but those of
    demonstrations.may_differ and the time limit. One that the file or the config does not name has its default. Of the
    library's own, kind, number, noise and the piece of furniture are compared too, of a user's file the noise and
    the piece where it says them: a run's config.yaml says what it learned from. Of a user's file the config also gets
    the SHA-256 (`DEMONSTRATIONS_READ`), since the file may say something else later.

    Raises:
        MissingFileError: there is no file.
        DemonstrationError: the file is wrong anywhere, or is of another task, subtask, settings, kind, number or noise.
        InvalidValueError: demonstrations.may_differ names what is no setting.
    """
    from tstar_rl.demonstrations.data_set import (
        Demonstrations,  # with torch, which paths and checks do without
    )
    from tstar_rl.demonstrations.formats import read_demonstrations

    given = config.demonstrations.get("file")
    if given is None:
        path = demonstrations_path(config, subtask, config.demonstrations.kind)
        if not path.is_file():
            raise MissingFileError(f"no demonstrations at {path}: {_made_by(config, subtask)}")
        found = Demonstrations.load(path, config.task.name, subtask)
        hint = "give the same, or delete it to make it again"
        made = _otherwise_made(config, config.demonstrations.kind, found.kind, len(found), found.noise)
        made += _other_furniture(config, found.furniture, AGAIN)
    else:
        path = _file_of(config, part_name(subtask))
        keys = config.demonstrations.observation_key, config.demonstrations.filter_key
        found = read_demonstrations(path, config.task.name, subtask, *keys)
        hint = (
            "give the same (env.<setting>=..., demonstrations.noise=...), or name a setting in "
            "demonstrations.may_differ=[...]"
        )
        made = _otherwise_noisy(config, config.demonstrations.kind, found.noise)
        made += _other_furniture(config, found.furniture)
    if wrong := [*other_settings(config, found.arguments), *made]:
        raise DemonstrationError(f"{path}: {'; '.join(wrong)}; {hint}")
    if given is not None:
        with open_dict(config):
            config[DEMONSTRATIONS_READ] = {
                **(config.get(DEMONSTRATIONS_READ) or {}),
                part_name(subtask): _digest(path),
            }
    return found.to(config.device)


def given_demonstrations(config: DictConfig, subtask: int | None, given: Any) -> "Demonstrations":
    """Demonstrations that a caller has, on the config's device: the library's, or anything with what training reads.

    That is "observations" (n, O) and "actions" (n, A); what has no `to` is taken to be on that device.

    Raises:
        DemonstrationError: the library's are of another task or subtask.
    """
    if hasattr(given, "check_of"):
        given.check_of(config.task.name, subtask)
    return given.to(config.device) if hasattr(given, "to") else given


def digests_of_file(config: DictConfig, parts: Iterable[str]) -> dict[str, str]:
    """What `DEMONSTRATIONS_READ` would say of demonstrations.file for these parts; nothing of a file that is gone."""
    paths = {part: _file_of(config, part) for part in parts}
    return {part: _digest(path) for part, path in paths.items() if path.is_file()}


def _file_of(config: DictConfig, part: str) -> Path:
    """The file of demonstrations.file that has a part."""
    given = Path(config.demonstrations.file)
    return given / f"{part}.hdf5" if given.is_dir() else given


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _made_by(config: DictConfig, subtask: int | None) -> str:
    """What a message says of demonstrations that are not there: the command that makes them."""
    part = "whole=true" if subtask is None else f"subtask={subtask}"
    seed = demonstrations_seed(config)
    values = f"task={config.task.name} {part} seed={seed} kinds=[{config.demonstrations.kind}]"
    return (
        f"make them first (python recipes/make_demonstrations.py {values}, "
        "with the scale and the folders given here)"
    )


def check_made(config: DictConfig, subtask: int | None, kind: str, furniture: bool = True) -> None:
    """Checks that the file of that subtask and kind is what recipes/make_demonstrations.py would make with the config.

    Args:
        config: of the recipe.
        subtask: of the demonstrations; None: of the whole task.
        kind: of the demonstrations.
        furniture: whether the piece is compared with that of this checkout.

    Raises:
        MissingFileError: there is no file.
        DemonstrationError: it cannot be read, or it is of another task or subtask, other settings, another number of
            episodes, another noise or another file of furniture. The last two are compared where a file says them.
        InvalidValueError: demonstrations.may_differ names what is no setting.
    """
    path = demonstrations_path(config, subtask, kind)
    made = read_made(path)
    found = {"task": made.header["task"], "subtask": made.header["subtask"]}
    wrong = differences(found, {"task": config.task.name, "subtask": subtask})
    wrong += other_settings(config, made.header["arguments"])
    wrong += _otherwise_made(config, kind, made.header["kind"], made.episodes, made.noise)
    wrong += _other_furniture(config, made.furniture, AGAIN) if furniture else []
    if wrong:
        raise DemonstrationError(
            f"{path}: {'; '.join(wrong)}; delete it, or set resume=false, to make it again"
        )


def _otherwise_made(
    config: DictConfig, kind: str, found: str, episodes: int, noise: float | None
) -> list[str]:
    """Readable differences between the kind, number and noise of demonstrations and those asked for.

    Args:
        config: whose demonstrations.episodes and demonstrations.noise are asked for.
        kind: asked for.
        found: the kind that the file says.
        episodes: that it has.
        noise: that it says; None where it does not.
    """
    asked, wrong = config.demonstrations, differences({"kind": found}, {"kind": kind})
    if episodes != asked.episodes:
        wrong.append(f"it has {episodes} episodes, and demonstrations.episodes is {asked.episodes}")
    return wrong + _otherwise_noisy(config, kind, noise)


def _otherwise_noisy(config: DictConfig, kind: str, noise: float | None) -> list[str]:
    """The same of the noise alone, which is compared where noisy demonstrations are asked for and a file says it."""
    if kind != "noisy" or noise is None or noise == config.demonstrations.noise:
        return []
    return [f"it was made with a noise of {noise}, and demonstrations.noise is {config.demonstrations.noise}"]


def _other_furniture(config: DictConfig, found: str | None, further: str = "") -> list[str]:
    """What to say where a file says that the piece was another one then.

    Args:
        config: of whose task the piece is.
        found: its digest, if the file has it.
        further: what follows from it.
    """
    from tstar_rl.env.task_tables import furniture_digest

    if found in (None, furniture_digest(config.task.name)):
        return []
    return [f"it was made with another {config.task.name}.yaml than there is now{further}"]


def other_settings(config: DictConfig, arguments: Mapping[str, Any], section: str = "") -> list[str]:
    """Readable differences between the settings of demonstrations, or of a skill, and the config's, of that section."""
    from tstar_rl.env.task_tables import DEFAULT_SETTINGS

    may_differ = (*config.demonstrations.may_differ, *ANY_VALUE)
    if told := unknown_setting(may_differ):
        raise InvalidValueError(f"demonstrations.may_differ has {told}")
    saved, wanted = DEFAULT_SETTINGS | dict(arguments), DEFAULT_SETTINGS | plain(config.env)
    compared = [name for name in DEFAULT_SETTINGS if name not in may_differ]
    return differences({k: saved[k] for k in compared}, {k: wanted[k] for k in compared}, section)
