"""How speed, memory and set-up grow with the number of simulations, threads and processes. Writes growth.csv.

    python recipes/bench_growth.py

Every row is measured in processes of its own: `setup_seconds` until the first observation, then random actions, resets
and all; `megabytes` is the largest resident memory of all its processes together, what Python and torch take included.
`load` is the machine's load average as the measurement began: it should be near zero. `growth_memory.csv` is the
largest resident memory of one training's collection after a number of rollouts. It should be flat. Its rows of a task
and scale are all of one process: a later run replaces them together.
"""

import os
import resource
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import wait
from pathlib import Path
from typing import Any

import torch
from bench_bare import environment_rate, random_policy
from hydra import compose, initialize_config_dir
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig
from tqdm import tqdm

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.build import environment, make_collection, new_skill
from tstar_rl.config.load import recipe
from tstar_rl.config.values import CONFIGS
from tstar_rl.launch.overrides import chosen_scale
from tstar_rl.runs.csv_tables import append_rows
from tstar_rl.seeds import derive_seed

PARTS = ((1, 1), (1, 2), (2, 1))
"""Processes, and threads of each."""


@dataclass(frozen=True)
class GrowthSection:
    """The section `growth` of `configs/recipe/bench_growth.yaml`."""

    sizes: tuple[int, ...]
    steps: int
    least: int
    rollouts: int
    rollout_envs: int
    rollout_horizon: int

    def __post_init__(self) -> None:
        most = max(processes for processes, _ in PARTS)
        wrong = [size for size in self.sizes if size < 1 or (size >= most and size % most)]
        if wrong or not self.sizes:
            raise InvalidValueError(
                f"growth.sizes must name numbers of simulations, each 1 or even, which {most} processes share; "
                f"got {wrong[0] if wrong else 'none'}"
            )


@recipe("bench_growth", growth=GrowthSection)
def main(config: DictConfig) -> None:
    """Measures and writes <results_dir>/growth.csv and growth_memory.csv; a row of the first as soon as it is there."""
    given, folder = list(HydraConfig.get().overrides.task), Path(config.results_dir)
    of = {"task": config.task.name, "scale": chosen_scale()}
    plan = [(size, *parts) for size in config.growth.sizes for parts in PARTS if size >= parts[0]]
    for size, processes, threads in tqdm(plan, disable=not config.progress_bar):
        row = of | measured(given, size, processes, threads)
        append_rows(folder / "growth.csv", [row], (*of, "num_envs", "processes", "threads"))
    append_rows(folder / "growth_memory.csv", [of | row for row in memory(config)], tuple(of))
    print(folder / "growth.csv", folder / "growth_memory.csv")


def measured(given: Sequence[str], size: int, processes: int, threads: int) -> dict[str, Any]:
    """A row: `size` simulations, shared out among `processes` processes of `threads` threads each.

    Args:
        given: values for the config.
        size: simulations in all.
        processes: that step their simulations at the same time.
        threads: of each.

    Raises:
        InvalidValueError: if the processes cannot have as many simulations each.
        RuntimeError: if a process ended without a result.
    """
    if size % processes:
        raise InvalidValueError(f"{size} simulations cannot be divided among {processes} processes")
    row = {"num_envs": size, "processes": processes, "threads": threads, "load": round(os.getloadavg()[0], 1)}
    spawn = get_context("spawn")
    together, pipes, children = spawn.Barrier(processes), [], []
    for _ in range(processes):
        ours, theirs = spawn.Pipe()
        arguments = (list(given), size // processes, threads, together, theirs)
        children.append(spawn.Process(target=_measure, args=arguments))
        children[-1].start()
        theirs.close()
        pipes.append(ours)
    found: dict[Any, tuple[float, float, float]] = {}
    try:
        while len(found) < processes:
            for pipe in wait([pipe for pipe in pipes if pipe not in found]):
                found[pipe] = pipe.recv()
        rates, seconds, megabytes = zip(*found.values(), strict=True)
    except EOFError:
        together.abort()  # the others wait there for the one that has ended
        raise RuntimeError(f"a process of {size // processes} simulations ended early") from None
    finally:
        for child in children:
            child.join()
    row |= {"steps_per_second": round(sum(rates), 1), "setup_seconds": round(max(seconds), 3)}
    return row | {"megabytes": round(sum(megabytes), 1)}


def _measure(given: list[str], size: int, threads: int, together: Any, answer: Any) -> None:
    """In a process of its own: sends steps a second, seconds of set-up, and largest resident memory."""
    torch.set_num_threads(1)
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/bench_growth", [*given, f"nthread={threads}"])
    seed = derive_seed(config.seed, "train")
    began = time.perf_counter()
    env = environment(config, config.subtask, size, seed, max_steps=config.training.max_steps)
    env.reset()
    setup = time.perf_counter() - began
    act = partial(random_policy, torch.Generator().manual_seed(seed))
    environment_rate(env, act, 2)
    steps = max(config.growth.steps, config.growth.least // size)
    together.wait()
    answer.send((environment_rate(env, act, steps), setup, largest_memory()))


def memory(config: DictConfig) -> Iterator[dict[str, Any]]:
    """Rows of the largest resident memory after some rollouts of a small training, ten over all of them."""
    growth = config.growth
    small = {"num_envs": growth.rollout_envs, "horizon": growth.rollout_horizon}
    config = DictConfig({**config, "training": {**config.training, **small}})
    seed = derive_seed(config.seed, "train")
    collection = make_collection(config, new_skill(config, config.subtask).policy, config.subtask, seed)
    for number in range(1, growth.rollouts + 1):
        collection.rollout()
        if number % max(growth.rollouts // 10, 1) == 0:
            yield {"rollouts": number, "megabytes": round(largest_memory(), 1)}
    collection.close()


def largest_memory() -> float:
    """Megabytes that this process has had resident at most."""
    kilobyte = 1 if sys.platform == "darwin" else 1024  # macOS counts bytes
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * kilobyte / 1e6


if __name__ == "__main__":
    main()
