"""How fast: bare simulator, environment, training, chaining, one simulation alone, TorchRL's wrapper. Writes bench.csv.

    python recipes/bench.py
    python recipes/bench.py bench.assemble=true   # also runs all of assemble.py
    python recipes/bench.py bench.measures=[chain] bench.starts=false scale=narrow bench.chain_rounds=4

`bare` is `mujoco.batch` stepping what the environment stepped: the same controls from the same states, resets not
timed. `env` is the environment on those random actions, resets and all; `train` is the loop of `gail_ppo.py` after its
warm start, and `bare_train` the bare simulator on the controls of that very loop; `chain` a turn of every skill by
`tstar.py`, see `bench_chain.py`. `single_*` is one simulation in a front, on random actions. `*_seconds` is what a user
waits for, see `bench_start.py`. `assemble_minutes` is what assemble.py last took from nothing. `ratio_to_bare` is
against the bare simulator under the same policy, see `BARE`.
`gpu_*`, where there is a GPU: see `bench_device.py`. A row says of which task and scale it is, and replaces the one of
the same task, scale and measure.
"""

import math
import os
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

os.environ.setdefault(
    "OMP_WAIT_POLICY", "passive"
)  # torch's idle threads must not hold the simulator's cores

import pandas as pd
import torch
from bench_bare import Replay, environment_rate, random_policy, replay, single_rates
from bench_chain import chain_rates
from bench_device import device_rows
from bench_start import start_rows
from bench_training import Training, warm_started
from bench_wrapped import wrapped_rate
from hydra import compose
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig
from tqdm import tqdm

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.build import environment
from tstar_rl.config.load import recipe
from tstar_rl.launch.overrides import chosen_scale, passed_on
from tstar_rl.launch.side_by_side import run_recipe
from tstar_rl.runs.csv_tables import append_rows, read_table
from tstar_rl.seeds import derive_seed

BARE = {
    "env_policy": "bare_policy",
    "train": "bare_train",
    "chain": "bare_chain",
    "single_gymnasium": "bare_single",
    "single_dm": "bare_single",
} | {f"bare_{under}": f"bare_{under}" for under in ("policy", "train", "chain", "single")}
"""The bare simulator under the same policy, of each measure where it is not `bare` (random actions)."""
OWN = ("bench", "subtask", "training")
"""Sections and keys that are not passed on: a chain has its own subtasks and number of simulations."""
KEY = ("task", "scale", "measure")
"""Columns of bench.csv of which no two rows have the same values."""


@dataclass(frozen=True)
class BenchSection:
    """The section `bench` of `configs/recipe/bench.yaml`."""

    measures: tuple[str, ...]
    starts: bool
    steps: int
    rounds: int
    updates: int
    workers: tuple[int, ...]
    worker_steps: int
    device_sizes: tuple[int, ...]
    chain_rounds: int
    single_steps: int
    assemble: bool

    def __post_init__(self) -> None:
        valid = (*MEASURES, GPU)
        unknown = [name for name in self.measures if name not in valid]
        if unknown:
            raise InvalidValueError(f"bench.measures has {unknown[0]!r}; valid are {', '.join(valid)}")
        for name in ("workers", "device_sizes"):
            if wrong := [size for size in getattr(self, name) if size < 1]:
                raise InvalidValueError(f"bench.{name} must be whole numbers from 1, got {wrong[0]}")


@recipe("bench", bench=BenchSection)
def main(config: DictConfig) -> None:
    """Measures, prints and writes <results_dir>/bench.csv."""
    given, scale = passed_on(OWN), chosen_scale()
    rates: dict[str, list[float]] = {}
    here = [name for name in config.bench.measures if name != GPU]
    for name in tqdm(here, disable=not config.progress_bar):
        torch.manual_seed(derive_seed(config.seed, "train"))
        for measured in MEASURES[name](config, given):
            for measure, rate in measured.items():
                rates.setdefault(measure, []).append(rate)
    path = Path(config.results_dir) / "bench.csv"
    waits = start_rows(given) if config.bench.starts else ()
    rows, of = [*rows_of(rates), *waits, *assemble_row(config, scale, given)], {"task": config.task.name}
    write([{**of, "scale": scale, **row} for row in rows], path)
    for row in on_a_gpu(HydraConfig.get().overrides.task) if GPU in config.bench.measures else ():
        print(row)
        append_rows(path, [{**of, "scale": GPU, **row}], KEY)  # at once: the largest number may not fit
    print(path)


def measure_environment(config: DictConfig, given: Sequence[str]) -> Iterator[dict[str, float]]:
    """Bare simulator and environment, on random actions."""
    bench, seed = config.bench, derive_seed(config.seed, "train")
    act = partial(random_policy, torch.Generator().manual_seed(seed))
    env = _environment(config, seed)
    told = replay(env, act, bench.steps)
    yield {"bare_one_thread": told.rate(1)}
    for _ in range(bench.rounds):
        yield {"bare": told.rate(config.nthread), "env": environment_rate(env, act, bench.steps)}


def measure_training(config: DictConfig, given: Sequence[str]) -> Iterator[dict[str, float]]:
    """Bare simulator, environment and training under a skill's policy."""
    bench, seed = config.bench, derive_seed(config.seed, "train")
    skill, expert = warm_started(config, seed)
    env = _environment(config, seed)
    told = replay(env, skill.policy, bench.steps)
    training = Training(config, skill, expert, _environment(config, seed), seed)
    training.rate(2)  # the first rollouts begin with all simulations at their start
    learned: list[float] = []
    for _ in range(bench.rounds):
        yield {"bare_policy": told.rate(config.nthread)}
        yield {"env_policy": environment_rate(env, skill.policy, bench.steps)}
        same = Replay(training.world, lambda: learned.append(training.rate(bench.updates)))
        yield {"train": learned[-1], "bare_train": same.rate(config.nthread)}


def measure_single(config: DictConfig, given: Sequence[str]) -> Iterator[dict[str, float]]:
    """One simulation: bare, and in Gymnasium's and dm_control's fronts."""
    bench, seed = config.bench, derive_seed(config.seed, "train")
    for _ in range(bench.rounds):
        yield single_rates(config.task.name, config.subtask, bench.single_steps, seed)


def measure_chain(config: DictConfig, given: Sequence[str]) -> Iterator[dict[str, float]]:
    """A T-STAR chain, and the bare simulator under its policies."""
    threads = [f"nthread={config.nthread}", f"torch_threads={config.torch_threads}"]
    yield chain_rates([*given, *threads], config.bench.chain_rounds, config.bench.steps)


def measure_wrapped(config: DictConfig, given: Sequence[str]) -> Iterator[dict[str, float]]:
    """TorchRL's wrapper around dm_control, alone and in processes."""
    for workers in config.bench.workers:
        name = f"torchrl_parallel_{workers}" if workers > 1 else "torchrl_one"
        yield {name: wrapped_rate(config.task.name, workers, config.bench.worker_steps)}


MEASURES = {
    "environment": measure_environment,
    "training": measure_training,
    "single": measure_single,
    "chain": measure_chain,
    "wrapped": measure_wrapped,
}
"""Names that `bench.measures` may have, beside `GPU`, and what yields rates of them, in environment steps a second."""
GPU = "gpu"
"""The name of the rows of `on_a_gpu`, which have units of their own, and of their scale."""


def _environment(config: DictConfig, seed: int):
    training = config.training
    return environment(config, config.subtask, training.num_envs, seed, max_steps=training.max_steps)


def on_a_gpu(given: Sequence[str]) -> Iterator[dict[str, Any]]:
    """The rows of a GPU, where there is one: at its own scale, with the other values that were given."""
    own = compose(
        "recipe/bench", [f"scale={GPU}", *(value for value in given if not value.startswith("scale="))]
    )
    if not (torch.cuda.is_available() and own.device.startswith("cuda")):
        print(
            "No CUDA device: the rows gpu_* (steps/s against N, training, time split, memory) are left out."
        )
        return
    seed = derive_seed(own.seed, "train")
    skill, expert = warm_started(own, seed)
    yield from device_rows(own, lambda sized, env: Training(sized, skill, expert, env, seed))


def rows_of(rates: dict[str, list[float]]) -> Iterator[dict[str, Any]]:
    """Medians, each with its ratio to the bare simulator under the same policy; of one simulation in two units."""
    middle = {name: median(values) for name, values in rates.items()}
    for name, rate in middle.items():
        ratio = round(rate / middle.get(BARE.get(name, "bare"), math.nan), 3)
        row = {
            "measure": name,
            "value": round(rate, 1),
            "unit": "environment steps / s",
            "ratio_to_bare": ratio,
        }
        if "single" not in name:
            yield row
            continue
        yield row | {"value": round(1000 / rate, 3), "unit": "ms / step"}
        yield row | {"measure": f"{name}_rate"}


def assemble_row(config: DictConfig, scale: str, given: Sequence[str]) -> Iterator[dict[str, Any]]:
    """The minutes of all of assemble.py from nothing: measured with bench.assemble=true, else those noted last."""
    with tempfile.TemporaryDirectory() as folder:
        results = config.results_dir
        if config.bench.assemble:
            results = f"{folder}/results"
            places = [f"{name}_dir={folder}/{name}" for name in ("runs", "demonstrations")]
            run_recipe(("assemble", *given, *places, f"results_dir={results}", "progress_bar=false"))
        file = Path(results) / "assemble.csv"
        known = read_table(file) if file.is_file() else pd.DataFrame()
    known = known.reindex(columns=["task", "scale", "seeds", "minutes"])  # older files have no scale
    of_one = (known["task"] == config.task.name) & (known["scale"] == scale) & (known["seeds"] == 1)
    known = known[of_one]
    if known.empty:
        print("No time of assemble.py: assemble_minutes is left out (bench.assemble=true measures it).")
    else:
        minutes = float(known["minutes"].iloc[-1])
        yield {"measure": "assemble_minutes", "value": minutes, "unit": "minutes"}


def write(rows: Sequence[dict[str, Any]], path: Path) -> None:
    """Writes the rows in the place of those of the same task, scale and measure, and prints the table."""
    columns = [*KEY, "value", "unit", "ratio_to_bare"]
    table = append_rows(path, pd.DataFrame(rows, columns=columns).to_dict("records"), KEY)
    if not table.empty:
        print(table.to_string(index=False))


if __name__ == "__main__":
    main()
