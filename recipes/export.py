"""Demonstrations, or episodes of a trained policy, in other libraries' formats: robomimic's HDF5 and Minari.

python recipes/export.py                                        # the demonstrations of every subtask
python recipes/export.py subtask=0 formats=[hdf5]
python recipes/export.py path=runs/table_lack/tstar/seed0/last  # 50 episodes of a chain, or of one skill
"""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import torch
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig
from torchrl.envs import set_exploration_type

from tstar_rl import FurnitureEnv
from tstar_rl.chaining.chain import ChainPolicy, chain_folders, chain_record
from tstar_rl.checks import InvalidValueError, MissingFileError
from tstar_rl.config.build import environment, load_skill
from tstar_rl.config.demonstrations import demonstrated, demonstrations_seed, load_demonstrations, part_name
from tstar_rl.config.load import recipe
from tstar_rl.config.overrides import section_of
from tstar_rl.config.recovery import refuse_recovery
from tstar_rl.config.values import plain
from tstar_rl.config.worlds import check_world
from tstar_rl.demonstrations.formats import (
    Recording,
    data_set_of_another_world,
    not_reproduced,
    of_another_world,
    read_hdf5,
    record,
    replay_demonstrations,
    write_hdf5,
    write_minari,
)
from tstar_rl.launch.evaluations import check_evaluation
from tstar_rl.rollouts.episodes import MODES
from tstar_rl.runs.checkpoint import is_checkpoint
from tstar_rl.runs.run_folder import read_run_path, run_path
from tstar_rl.seeds import derive_seed

FORMATS = ("hdf5", "minari")


@recipe(
    "export",
    path=str | None,
    dataset=str | None,
    formats=tuple[str, ...],
    exports_dir=str,
    episodes=int,
    mode=str,
    whole=bool,
    check=bool,
)
def main(config: DictConfig) -> None:
    """Writes one file or data set for each subtask, or for the whole task."""
    for name in config.formats:
        if name not in FORMATS:
            raise InvalidValueError(f"formats must be of {', '.join(FORMATS)}; got {name!r}")
    _check_asked(config, HydraConfig.get().overrides.task)
    drawn = "" if config.path is None or config.mode == "deterministic" else f"_{config.mode}"
    name = config.dataset or f"{_name(config)}{drawn}"
    if not name or name != _allowed(name):
        raise InvalidValueError(
            f"dataset must be of letters, digits, - and _, as Minari's names are; got {name!r}"
        )
    for recording in _recordings(config):
        part, task = part_name(recording.arguments["subtask"]), config.task.name
        won = len(recording.successes.episodes)
        print(f"{task}, {part}: {len(recording.episodes)} episodes, of which {won} succeeded")
        if not recording.episodes:
            continue
        path = Path(config.exports_dir) / task / name / f"{part}.hdf5"
        root = os.environ.get("MINARI_DATASETS_PATH") or Path(config.exports_dir) / "minari"
        dataset_id = f"tstar/{task}/{part}_{name}-v0"
        if "hdf5" in config.formats:
            _refuse(path, of_another_world(recording, path))
        if "minari" in config.formats:
            _refuse(Path(root) / dataset_id, data_set_of_another_world(recording, dataset_id, root))
        if "hdf5" in config.formats:
            write_hdf5(recording, path)
            print(f"  {path}{_played_again(path, config) if config.check else ''}")
        if "minari" in config.formats:
            write_minari(recording, dataset_id, root)
            print(f"  MINARI_DATASETS_PATH={root}: {dataset_id}")


def _check_asked(config: DictConfig, given: Sequence[str]) -> None:
    """Refuses what is of a policy's episodes where none are made.

    Raises:
        InvalidValueError: with the value that was given.
    """
    of_episodes = [value for value in given if section_of(value) in ("episodes", "mode")]
    if config.path is None and of_episodes:
        raise InvalidValueError(
            f"{of_episodes[0]} is of path=..., whose skill or chain is run; without it demonstrations go out: give "
            "path=..., or leave episodes=... and mode=... out"
        )


def _refuse(path: Path, differences: list[str]) -> None:
    if differences:
        raise InvalidValueError(
            f"{path} is of another world: {'; '.join(differences)}. Give dataset=... or exports_dir=..., or delete it"
        )


def _name(config: DictConfig) -> str:
    """Of demonstrations: kind and seed, or imported and the file's name. Of a checkpoint: folders below the task's."""
    if config.path is None and config.demonstrations.get("file") is not None:
        given = Path(config.demonstrations.file).resolve()
        return f"imported_{_allowed(given.name if given.is_dir() else given.stem)}"
    if config.path is None:
        return f"{config.demonstrations.kind}_seed{demonstrations_seed(config)}"
    parts = Path(config.path).resolve().parts
    below = len(parts) - parts[::-1].index(config.task.name) if config.task.name in parts else len(parts) - 1
    return _allowed("_".join(part for part in parts[below:] if not part.startswith("subtask")))


def _allowed(name: str) -> str:
    """The name with each run of characters that Minari does not take as one _."""
    return re.sub(r"[^a-zA-Z0-9_-]+", "_", name)


def _recordings(config: DictConfig) -> Iterator[Recording]:
    if config.path is not None:
        yield _episodes(config)
        return
    for subtask in demonstrated(config):
        found = load_demonstrations(config, subtask)
        with _playing(config, found.arguments, len(found)) as env:
            played = replay_demonstrations(env, found, _source(config, subtask))
        if lost := len(found) - len(played.successes.episodes):
            print(f"{lost} of {len(found)} demonstrations did not succeed again and are left out")
        yield played.successes


def _source(config: DictConfig, subtask: int | None) -> str:
    """The name of the user's file that demonstrations.file names, with its folder's where it names that."""
    given = Path(config.demonstrations.get("file") or "").resolve()
    return f"{given.name}/{part_name(subtask)}.hdf5" if given.is_dir() else given.name


def _episodes(config: DictConfig) -> Recording:
    """Episodes of the skill or the chain at config.path."""
    path = Path(config.path)
    chain = not is_checkpoint(path)
    folders = chain_folders(path) if chain else [path]
    if not folders:
        raise MissingFileError(f"no skill and no chain at {path}")
    refuse_recovery(folders[0])
    _check_world(config)
    check_world(config, folders[0])
    whole = chain_record(folders[0])  # one that a training replaces meanwhile is not read by halves
    skills = [load_skill(folder, task=config.task.name, chain=whole).to(config.device) for folder in folders]
    if chain and len(skills) < config.task.subtasks:
        raise InvalidValueError(
            f"{path} is a chain of {len(skills)} of {config.task.subtasks} skills, whose episodes do not end with it: "
            "only whole chains and single skills are exported"
        )
    subtask, policy = (None, ChainPolicy(skills)) if chain else (skills[0].subtask, skills[0].policy)
    if config.subtask not in (None, subtask) or (config.whole and subtask is not None):
        raise InvalidValueError(
            f"{path} is of {part_name(subtask)}; got subtask={config.subtask} whole={str(config.whole).lower()}"
        )
    seed = derive_seed(config.seed, "export", list(MODES).index(config.mode), subtask)
    torch.manual_seed(seed)
    env = environment(config, subtask, config.episodes, seed, snapshots=True).base_env
    with closing(env), set_exploration_type(MODES[config.mode]):
        return record(env, policy, f"{_name(config)}, {config.mode}", seed)


def _check_world(config: DictConfig) -> None:
    """Refuses another world than that of the run that config.path is of; a path of no run is taken as it is.

    The time limit may differ: no training has one in its world, and the file says it.

    Raises:
        InvalidValueError: the run is of another task.
        CheckpointMismatchError: with what differs.
    """
    path, root = Path(config.path).resolve(), Path(config.runs_dir).resolve()
    if not path.is_relative_to(root):
        return
    try:
        place, _ = read_run_path(path.relative_to(root))
    except InvalidValueError:
        return
    if place.task != config.task.name:  # as runs/quick/table_lack/... is, where runs_dir is runs
        raise InvalidValueError(
            f"path={config.path} is of task={place.task}, but task={config.task.name} is asked for: "
            "give the scale and the folders of its run"
        )
    values = plain(config)
    values["env"].pop("max_steps", None)
    check_evaluation(run_path(config.results_dir, *place), values)


def _played_again(path: Path, config: DictConfig) -> str:
    """What came of playing a file's episodes from their first states."""
    recording = read_hdf5(path)
    number = len(recording.episodes)
    with _playing(config, recording.arguments, number) as env:
        wrong = not_reproduced(env, recording)
    if not wrong:
        return f": played again from its states, {number} of {number} the same to the bit"
    row, told = next(iter(wrong.items()))
    return f": played again from its states, {len(wrong)} of {number} differ; demo_{row}: {'; '.join(told)}"


def _playing(config: DictConfig, arguments: Mapping[str, Any], episodes: int) -> closing[FurnitureEnv]:
    """Simulations that play episodes again, as many at a time as demonstrations are made in."""
    where = {"nthread": config.nthread, "device": config.device, "physics": config.physics}
    number = min(config.demonstrations.num_envs, episodes)
    return closing(FurnitureEnv(**arguments, **where, num_envs=number, snapshots=True))


if __name__ == "__main__":
    main()
