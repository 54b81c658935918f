"""Which demonstrations a config's recipe learns from: the library's own, or a user's file."""

from pathlib import Path

from omegaconf import DictConfig

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.values import plain
from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.demonstrations.file_check import KINDS, DemonstrationError
from tstar_rl.demonstrations.formats import read_demonstrations
from tstar_rl.runs.checkpoint import differences

__all__ = ["demonstrations_path", "load_demonstrations", "part_name"]


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
    seed = config.seed if config.demonstrations.seed is None else config.demonstrations.seed
    folder = Path(config.demonstrations_dir) / config.task.name / f"seed{seed}"
    return folder / f"{part_name(subtask)}_{kind}.npz"


def load_demonstrations(config: DictConfig, subtask: int | None) -> Demonstrations:
    """Those that the config's recipe learns from: of demonstrations.file, or made by recipes/make_demonstrations.py.

    A setting of the environment that their file does not name had its default.

    Raises:
        MissingFileError: there is no file.
        DemonstrationError: something in the file is wrong, or it is of another task, subtask or settings.
    """
    from tstar_rl.env.task_tables import DEFAULT_SETTINGS

    given = config.demonstrations.get("file")
    if given is None:
        path = demonstrations_path(config, subtask, config.demonstrations.kind)
        found, hint = Demonstrations.load(path, config.task.name, subtask), "delete it to make it again"
    else:
        path = Path(given) / f"{part_name(subtask)}.hdf5" if Path(given).is_dir() else Path(given)
        keys = config.demonstrations.observation_key, config.demonstrations.filter_key
        found = read_demonstrations(path, config.task.name, subtask, *keys)
        hint = "give the same (env.<setting>=...), or name what may differ in demonstrations.may_differ=[...]"
    wanted = {k: v for k, v in plain(config.env).items() if k not in config.demonstrations.may_differ}
    saved = DEFAULT_SETTINGS | found.arguments
    wrong = differences({name: saved.get(name) for name in wanted}, wanted)
    if wrong:
        raise DemonstrationError(f"{path}: field arguments: {'; '.join(wrong)}; {hint}")
    return found.to(config.device)
