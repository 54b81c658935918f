"""Short recordings for tests, and HDF5 files with something changed."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import torch

from tstar_rl import Demonstrations, FurnitureEnv
from tstar_rl.demonstrations.formats import Recording, record

ARGUMENTS: dict[str, Any] = {"task": "chair_ingolf", "subtask": 1}


def make(num_envs: int = 2, seed: int = 0, **settings: Any) -> FurnitureEnv:
    return FurnitureEnv(num_envs=num_envs, nthread=1, seed=seed, snapshots=True, **{**ARGUMENTS, **settings})


def scripted(num_envs: int = 2, seed: int = 0, noise: float = 0.05, **settings: Any) -> Recording:
    env = make(num_envs, seed, **settings)
    return record(env, env.expert(noise, torch.Generator().manual_seed(seed)), "the script", seed)


def as_demonstrations(recording: Recording, kind: str = "noisy") -> Demonstrations:
    """The library's own data set of these episodes; what an expert would have done is half of what was done."""
    episodes = recording.episodes
    executed = torch.cat([one.actions for one in episodes])
    return Demonstrations(
        task=recording.arguments["task"],
        subtask=recording.arguments["subtask"],
        kind=kind,
        arguments=recording.arguments,
        seeds=torch.tensor([one.seed for one in episodes]),
        lengths=torch.tensor([len(one) for one in episodes]),
        observations=torch.cat([one.observations[:-1] for one in episodes]),
        actions=executed / 2,
        executed=executed,
        success=torch.ones(len(episodes), dtype=torch.bool),
        snapshots=torch.cat([one.states[:-1] for one in episodes]),
    )


def changed(path: Path, change: Callable[[h5py.File], Any]) -> Path:
    """The file after `change` has been at it."""
    with h5py.File(path, "r+") as file:
        change(file)
    return path


def put(name: str, value: Any) -> Callable[[h5py.File], None]:
    """A change: the array of that name is another, or goes with None."""

    def change(file: h5py.File) -> None:
        if name in file:
            del file[name]
        if value is not None:
            file[name] = value

    return change
