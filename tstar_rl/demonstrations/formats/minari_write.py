"""Writes episodes as a Minari data set; `minari.load_dataset` reads it, `recover_environment` makes its environment."""

import json
import os
import shutil
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

import torch

from tstar_rl.checks import InvalidValueError, import_extra
from tstar_rl.demonstrations.formats.recording import Episode, Recording
from tstar_rl.demonstrations.formats.states import StateLayout
from tstar_rl.runs.files import put_back, remove_remains, replace_folder, turn_to_write
from tstar_rl.runs.mismatch import differences

__all__ = ["ROOT", "data_set_of_another_world", "write_minari"]

ROOT = "MINARI_DATASETS_PATH"
"""The environment variable in which Minari looks for the folder of all data sets; without it that is ~/.minari."""
INFOS = ("subtask", "phase", "completed", "success")
"""Of the state of the task, what `info` has in the Gymnasium environments too."""


def write_minari(recording: Recording, dataset_id: str, root: str | Path) -> Path:
    """Writes a data set below `root`; one of that name that is there stays whole until the new one is complete.

    A kill between the two leaves the old one hidden beside it, and the next call puts it back first. What else a kill
    has left of this data set is removed.

    Observations and infos have T + 1 rows, the rest T. `infos["state"]` are full states, and the metadata's
    `state_layout` says what is where in them; `infos["expert_action"]` (last row 0) is what to imitate, where an
    expert was asked. `model_xml` in the metadata is the scene, `noise` that of the recording, where it is known.

    Args:
        recording: what is written.
        dataset_id: such as `tstar/<task>/<name>-v0`.
        root: the folder of all data sets.

    Returns:
        The folder of the data set.

    Raises:
        MissingExtraError: Minari or h5py is not installed.
        InvalidValueError: the id is not one that Minari takes.
        ValueError: there is no episode to write.
    """
    if not recording.episodes:
        raise ValueError(f"there is no episode to write to {dataset_id}")
    for library in ("minari", "h5py"):
        import_extra(library, "export", "a Minari data set")
    from minari.dataset.minari_dataset import parse_dataset_id

    try:
        parse_dataset_id(dataset_id)
    except (ValueError, TypeError) as error:
        raise InvalidValueError(
            f"{dataset_id!r} is no id of a Minari data set: write namespace/name-v0"
        ) from error
    root = Path(root).resolve()
    root.mkdir(parents=True, exist_ok=True)
    writing = f".writing-{dataset_id.replace('/', '_')}-"
    with turn_to_write(root):  # what another process is writing is no remains
        put_back(root / dataset_id)
        remove_remains(root / dataset_id)
        for left in root.glob(f"{writing}*"):
            shutil.rmtree(left, ignore_errors=True)
        with tempfile.TemporaryDirectory(dir=root, prefix=writing) as folder, _datasets_in(folder):
            _create(recording, dataset_id)
            _move(Path(folder), root, dataset_id)
    return root / dataset_id


def data_set_of_another_world(recording: Recording, dataset_id: str, root: str | Path) -> list[str]:
    """Readable differences between the world of a data set that is there and a recording's; none where none is."""
    put_back(place := Path(root).resolve() / dataset_id)
    if not place.is_dir():
        return []
    try:
        metadata = json.loads((place / "data" / "metadata.json").read_text())
        there = json.loads(metadata["env_spec"])["kwargs"]
    except (OSError, KeyError, TypeError, ValueError):
        return ["it is no data set of Minari's with an environment"]
    return differences(there, json.loads(json.dumps(recording.arguments)))


def _create(recording: Recording, dataset_id: str) -> None:
    import minari

    from tstar_rl.env.their_names import gymnasium_spec, model_xml

    layout = StateLayout.of(recording.episodes[0].states)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that there is no author, no e-mail address, no link
        dataset = minari.create_dataset_from_buffers(
            dataset_id,
            [_buffer(episode, layout) for episode in recording.episodes],
            env=gymnasium_spec(recording.arguments),
            algorithm_name=recording.made_by,
            description="Furniture assembly by a Sawyer arm, recorded with tstar_rl.",
            requirements=[f"mujoco=={version('mujoco')}"],
            data_format="hdf5",
        )
    task = recording.arguments["task"]
    metadata = {"state_layout": layout.to_json(), "model_xml": model_xml(task)}
    if recording.noise is not None:
        metadata["noise"] = recording.noise
    dataset.storage.update_metadata(metadata)


def _buffer(episode: Episode, layout: StateLayout) -> Any:
    from minari.data_collector import EpisodeBuffer

    infos: dict[str, Any] = {name: episode.states["task", name].numpy() for name in INFOS}
    infos["state"] = layout.rows(episode.states).numpy()
    if episode.labels is not None:
        infos["expert_action"] = torch.cat([episode.labels.cpu(), torch.zeros(1, 9)]).numpy()
    return EpisodeBuffer(
        seed=episode.seed,
        observations=episode.observations.numpy(),
        actions=episode.actions.numpy(),
        rewards=episode.rewards.numpy(),
        terminations=episode.terminated.numpy(),
        truncations=episode.truncated.numpy(),
        infos=infos,
    )


@contextmanager
def _datasets_in(folder: str) -> Iterator[None]:
    """Minari writes to the folder that an environment variable names."""
    before = os.environ.get(ROOT)
    os.environ[ROOT] = folder
    try:
        yield
    finally:
        os.environ.pop(ROOT)
        if before is not None:
            os.environ[ROOT] = before


def _move(written: Path, root: Path, dataset_id: str) -> None:
    """Puts a data set, and what says that its namespaces are some, from `written` into `root`."""
    for file in written.rglob("namespace_metadata.json"):
        there = root / file.relative_to(written)
        there.parent.mkdir(parents=True, exist_ok=True)
        if not there.exists():
            shutil.copy(file, there)
    replace_folder(written / dataset_id, root / dataset_id)
