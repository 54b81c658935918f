"""Short recordings for tests, and HDF5 files with something changed."""

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import torch

from tstar_rl import Demonstrations, FurnitureEnv
from tstar_rl.demonstrations.formats import Recording, record

ARGUMENTS: dict[str, Any] = {"task": "chair_ingolf", "subtask": 1}

STEPS, WIDTH = (
    (3, 2),
    72,
)  # of the two demonstrations that anybody wrote; an observation of the five parts of the chair


def make(num_envs: int = 2, seed: int = 0, **settings: Any) -> FurnitureEnv:
    return FurnitureEnv(num_envs=num_envs, nthread=1, seed=seed, snapshots=True, **{**ARGUMENTS, **settings})


def scripted(num_envs: int = 2, seed: int = 0, noise: float = 0.05, **settings: Any) -> Recording:
    env = make(num_envs, seed, **settings)
    return record(env, env.expert(noise, torch.Generator().manual_seed(seed)), "the script", seed)


def labelled_script() -> Recording:
    """Two successes, with labels as if an expert had been asked."""
    found = scripted()
    assert [episode.succeeded for episode in found.episodes] == [True, True]
    labelled = [replace(one, labels=one.actions.neg()) for one in found.episodes]
    return replace(found, episodes=labelled)


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


def made_up() -> Demonstrations:
    """Two made-up demonstrations of 3 and 4 steps, in which everything has its shape."""
    rows = 7
    snapshots = FurnitureEnv("table_lack", rows, nthread=1).snapshot()
    snapshots["physics"] = torch.randn_like(snapshots["physics"])
    snapshots["task", "phase"] = torch.arange(rows)
    return Demonstrations(
        task="table_lack",
        subtask=2,
        kind="noisy",
        arguments={"task": "table_lack", "velocity_scale": 0.4},
        seeds=torch.tensor([5, 5]),
        lengths=torch.tensor([3, 4]),
        observations=torch.randn(rows, 72),
        actions=torch.rand(rows, 9) - 0.5,
        executed=torch.rand(rows, 9) - 0.5,
        success=torch.ones(2, dtype=torch.bool),
        snapshots=snapshots,
    )


def leave_demonstrations(file: Path, config: Mapping[str, Any]) -> None:
    """As much of a file that a config asks for as is compared: what it is of, the number of episodes, the noise."""
    part, _, kind = file.stem.partition("_")
    subtask = None if part == "whole" else int(part.removeprefix("subtask"))
    header = {"format_version": 1, "task": config["task"]["name"], "subtask": subtask, "kind": kind}
    header["arguments"] = config["env"]
    asked = config["demonstrations"]
    lengths, noise = np.ones(asked["episodes"], int), np.array(float(asked["noise"]))
    file.parent.mkdir(parents=True, exist_ok=True)
    np.savez(file, header=np.array(json.dumps(header)), lengths=lengths, noise=noise)


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


def env_args(name: str = "tstar/ChairIngolf-v0", **settings) -> str:
    return json.dumps({"env_name": name, "type": 2, "env_kwargs": settings})


def leave_two_of_anybody(path: Path) -> Path:
    """What anybody could write: two demonstrations, of observations and actions alone."""
    with h5py.File(path, "w") as file:
        file.create_group("data").attrs["env_args"] = env_args(subtask=1, velocity_scale=0.5)
        for name, steps, seed in zip(("demo_10", "demo_2"), STEPS, (1, 2), strict=True):
            numbers = np.random.default_rng(seed)
            file[f"data/{name}/actions"] = numbers.uniform(-1, 1, (steps, 9))
            file[f"data/{name}/obs/flat"] = numbers.normal(size=(steps, WIDTH))
    return path
