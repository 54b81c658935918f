"""From an HDF5 file to what is learned from, or to episodes that can be played again."""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from tensordict import TensorDict
from torch import Tensor

from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.demonstrations.file_check import DemonstrationError, snapshot_layout
from tstar_rl.demonstrations.formats.hdf5_check import Contents, read_contents
from tstar_rl.demonstrations.formats.recording import Episode, Recording
from tstar_rl.demonstrations.formats.states import StateLayout

__all__ = ["read_demonstrations", "read_hdf5"]

NEEDED = ("next_observations", "rewards", "terminations", "truncations", "successes", "states", "final_state")
"""What a demonstration must have to be played again; learning from it does without."""


def read_demonstrations(
    path: str | Path,
    task: str | None = None,
    subtask: int | None = None,
    observation_key: str | None = None,
    filter_key: str | None = None,
) -> Demonstrations:
    """What recipes learn from; of anybody's file that has actions and observations.

    The labels are `expert_actions` where a demonstration has them, else `actions`. There are snapshots if all
    demonstrations have states and the file says what is where in them.

    Args:
        path: of the file.
        task: that it must be of; None: any.
        subtask: likewise, where a task is given; None: the whole task.
        observation_key: see `read_contents`.
        filter_key: see `read_contents`.

    Raises:
        MissingFileError, MissingExtraError, DemonstrationError: see `read_contents`; also for another task or subtask.
    """
    contents = read_contents(path, observation_key, filter_key)
    if task is not None and (contents.task, contents.subtask) != (task, subtask):
        raise DemonstrationError(
            f"{path}: is of {_said(contents.task, contents.subtask)}; wanted {_said(task, subtask)}"
        )
    demos = list(contents.demos.values())
    lengths = [len(demo["actions"]) for demo in demos]
    return Demonstrations(
        task=contents.task,
        subtask=contents.subtask,
        kind="imported",
        arguments={"task": contents.task, "subtask": contents.subtask, **contents.settings},
        seeds=torch.tensor(contents.seeds),
        lengths=torch.tensor(lengths),
        observations=_together([demo["observations"] for demo in demos]),
        actions=_together([demo.get("expert_actions", demo["actions"]) for demo in demos]),
        executed=_together([demo["actions"] for demo in demos]),
        success=torch.ones(len(demos), dtype=torch.bool),
        snapshots=_snapshots(path, contents, sum(lengths)),
        noise=_noise(path, contents),
        furniture=_furniture(path, contents),
    )


def read_hdf5(path: str | Path) -> Recording:
    """What `write_hdf5` wrote.

    Raises:
        MissingFileError, MissingExtraError, DemonstrationError: see `read_contents`; also where a demonstration lacks
            what it takes to play it again.
    """
    contents = read_contents(path, failures=True)
    for name, demo in contents.demos.items():
        for key in NEEDED:
            if key not in demo:
                raise DemonstrationError(f"{path}: {name} has no {key}, so it cannot be played again")
    layout = _layout(path, contents)
    episodes = [
        _episode(path, name, demo, layout, seed)
        for (name, demo), seed in zip(contents.demos.items(), contents.seeds, strict=True)
    ]
    arguments = {"task": contents.task, "subtask": contents.subtask, **contents.settings}
    made_by = str(contents.attributes.get("made_by", ""))
    return Recording(arguments, made_by, episodes, _noise(path, contents), _furniture(path, contents))


def _layout(path: str | Path, contents: Contents) -> StateLayout:
    try:
        return StateLayout.from_json(contents.attributes["state_layout"])
    except (KeyError, ValueError) as error:
        raise DemonstrationError(f"{path}: attribute state_layout of data: {error}") from error


def _noise(path: str | Path, contents: Contents) -> float | None:
    if "noise" not in contents.attributes:
        return None
    value = np.asarray(found := contents.attributes["noise"])
    if value.shape or value.dtype.kind not in "iuf" or not np.isfinite(value) or value < 0:
        said = found.item() if isinstance(found, np.generic) else found
        raise DemonstrationError(f"{path}: attribute noise of data is {said!r}, should be one number from 0")
    return float(value)


def _furniture(path: str | Path, contents: Contents) -> str | None:
    found = contents.attributes.get("furniture")
    if isinstance(found, bytes):
        found = found.decode(errors="replace")
    if not isinstance(found, str | None):
        raise DemonstrationError(f"{path}: attribute furniture of data is {found!r}, should be text")
    return found


def _episode(
    path: str | Path, name: str, demo: dict[str, np.ndarray], layout: StateLayout, seed: int
) -> Episode:
    try:
        states = layout.snapshots(torch.from_numpy(np.vstack([demo["states"], demo["final_state"]])))
    except ValueError as error:
        raise DemonstrationError(f"{path}: {name}/states: {error}") from error
    flags = (torch.from_numpy(demo[key]) > 0 for key in ("terminations", "truncations", "successes"))
    return Episode(
        torch.from_numpy(np.vstack([demo["observations"], demo["next_observations"][-1:]])),
        torch.from_numpy(demo["actions"]),
        torch.from_numpy(demo["rewards"]),
        *flags,
        states=states,
        labels=torch.from_numpy(demo["expert_actions"]) if "expert_actions" in demo else None,
        seed=seed,
    )


def _snapshots(path: str | Path, contents: Contents, rows: int) -> TensorDict:
    """The states of all demonstrations, batch [rows]; empty ones where the file does not have or explain them."""
    states = [demo["states"] for demo in contents.demos.values() if "states" in demo]
    if len(states) < len(contents.demos) or "state_layout" not in contents.attributes:
        return TensorDict({}, [rows])
    layout = _layout(path, contents)
    found = {f"snapshot/{entry.name}": (entry.shape, np.dtype(entry.dtype)) for entry in layout.entries}
    wanted = snapshot_layout(contents.task)
    if found != wanted:
        odd = sorted({name.removeprefix("snapshot/") for name, _ in found.items() ^ wanted.items()})
        raise DemonstrationError(
            f"{path}: state_layout is not that of a state of {contents.task}; it differs in {', '.join(odd)}"
        )
    try:
        return layout.snapshots(_together(states))
    except (ValueError, RuntimeError) as error:  # also rows of different widths
        raise DemonstrationError(f"{path}: states do not fit state_layout: {error}") from error


def _together(arrays: list[np.ndarray]) -> Tensor:
    return torch.cat([torch.from_numpy(array) for array in arrays])


def _said(task: Any, subtask: int | None) -> str:
    return f"{task}, the whole task" if subtask is None else f"{task}, subtask {subtask}"
