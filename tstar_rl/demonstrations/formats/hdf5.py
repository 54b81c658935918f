"""Writes episodes as robomimic-style HDF5: one group a demonstration, with full states and the model's XML.

    data                 attrs: total, env_args (JSON), state_layout (JSON), made_by, mujoco_version;
                                noise, furniture (a digest), where they are known
      demo_0             attrs: num_samples, model_file (XML), success, seed
        obs/flat         (T, O) float32, before each action; next_obs/flat after it
        actions          (T, 9) float32 in [-1, 1], what the environment was given
        expert_actions   (T, 9) float32 in [-1, 1], what to imitate, of demonstrations; in plain ones `actions`
        rewards, dones   (T,)
        terminations, truncations, successes  (T,), 0 or 1
        states           (T, D) float64, before each action; final_state (D,) after the last one
    mask                 successes, failures: names of demonstrations

Source: robomimic's documentation, "Dataset structure"; `flat` is what it calls an observation that is one vector.
"""

import io
import json
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from tstar_rl.checks import import_extra
from tstar_rl.demonstrations.formats.recording import Episode, Recording
from tstar_rl.demonstrations.formats.states import StateLayout
from tstar_rl.runs.files import replacing, turn_to_write
from tstar_rl.runs.mismatch import differences

__all__ = ["OBSERVATION_KEY", "h5py", "of_another_world", "write_hdf5"]

OBSERVATION_KEY = "flat"
GYMNASIUM = 2
"""robomimic's number for environments that Gymnasium makes."""
STORED: dict[str, Any] = {"compression": "gzip", "shuffle": True, "fletcher32": True}
"""Of every array: small, and a damaged one cannot be read as another."""


def h5py() -> Any:
    """The library; raises MissingExtraError where it is not installed."""
    return import_extra("h5py", "export", "an HDF5 file")


def write_hdf5(recording: Recording, path: str | Path) -> Path:
    """Writes a file; one that is there stays whole until the new one is complete.

    Raises:
        MissingExtraError: h5py is not installed.
        ValueError: there is no episode to write.
    """
    if not recording.episodes:
        raise ValueError(f"there is no episode to write to {path}")
    written, path = io.BytesIO(), Path(path)
    with h5py().File(written, "w", libver=("v110", "v110")) as file:  # from 1.10 on, headers have checksums
        _fill(file, recording)
    with turn_to_write(path.parent), replacing(path) as partial:
        partial.write_bytes(written.getbuffer())
    return path


def of_another_world(recording: Recording, path: str | Path) -> list[str]:
    """Readable differences between the world of a file that is there and a recording's; none where no file is.

    Raises:
        MissingExtraError: h5py is not installed.
    """
    if not Path(path).is_file():
        return []
    try:
        with h5py().File(path, "r") as file:
            there = json.loads(file["data"].attrs["env_args"])["env_kwargs"]
    except (OSError, KeyError, TypeError, ValueError):
        return ["it is no file of episodes"]
    return differences(there, json.loads(json.dumps(recording.arguments)))


def _fill(file: Any, recording: Recording) -> None:
    from tstar_rl.env.their_names import gymnasium_id, model_xml

    arguments, data = recording.arguments, file.create_group("data")
    layout, xml = StateLayout.of(recording.episodes[0].states), model_xml(arguments["task"])
    name = gymnasium_id(arguments["task"])
    env_args = {"env_name": name, "env_version": "0", "type": GYMNASIUM, "env_kwargs": arguments}
    # Text of fixed length lies in the group's header, which has a checksum; other text does not.
    data.attrs["env_args"] = np.bytes_(json.dumps(env_args))
    data.attrs["state_layout"] = np.bytes_(layout.to_json())
    data.attrs["made_by"] = recording.made_by
    data.attrs["mujoco_version"] = version("mujoco")
    if recording.noise is not None:
        data.attrs["noise"] = recording.noise
    if recording.furniture is not None:
        data.attrs["furniture"] = np.bytes_(recording.furniture)
    data.attrs["total"] = sum(map(len, recording.episodes))
    groups: dict[str, list[str]] = {"successes": [], "failures": []}
    for index, episode in enumerate(recording.episodes):
        demo = data.create_group(f"demo_{index}")
        _fill_demo(demo, episode, layout)
        demo.attrs["model_file"] = xml
        groups["successes" if episode.succeeded else "failures"].append(f"demo_{index}")
    for name, demos in groups.items():
        file.create_dataset(f"mask/{name}", data=np.array(demos, dtype="S"))


def _fill_demo(demo: Any, episode: Episode, layout: StateLayout) -> None:
    states = layout.rows(episode.states).numpy()
    observations = episode.observations.numpy()
    arrays = {
        f"obs/{OBSERVATION_KEY}": observations[:-1],
        f"next_obs/{OBSERVATION_KEY}": observations[1:],
        "actions": episode.actions.numpy(),
        "rewards": episode.rewards.numpy(),
        "dones": (episode.terminated | episode.truncated).to("cpu").numpy().astype(np.uint8),
        "terminations": episode.terminated.numpy().astype(np.uint8),
        "truncations": episode.truncated.numpy().astype(np.uint8),
        "successes": episode.success.numpy().astype(np.uint8),
        "states": states[:-1],
        "final_state": states[-1],
    }
    if episode.labels is not None:
        arrays["expert_actions"] = episode.labels.cpu().numpy()
    for name, array in arrays.items():
        demo.create_dataset(name, data=array, **STORED)
    demo.attrs["num_samples"] = len(episode)
    demo.attrs["success"] = episode.succeeded
    demo.attrs["seed"] = episode.seed
