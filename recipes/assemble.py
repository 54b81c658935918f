"""The whole pipeline: demonstrations, skills, chaining three ways, evaluation, films, curves.

    python recipes/assemble.py scale=laptop seed=0        # or scale=quick

What is given on the command line is passed on to every step. A step that is done is not done again; one that was
killed goes on from its last checkpoint.
"""

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pandas as pd
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig

from tstar_rl.configuration import recipe
from tstar_rl.logging import run_path

RECIPES = Path(__file__).resolve().parent
OWN = ("processes",)  # values that only this recipe knows

Step = tuple[str, ...]


def _step(step: Step, shared: Sequence[str], lane: int) -> None:
    """Runs one recipe in a process of its own; its progress bar takes the screen's line `lane`."""
    name, *values = step
    environ = {**os.environ, "TQDM_POSITION": str(lane), "TQDM_MININTERVAL": "1", "OMP_NUM_THREADS": "1"}
    command = [sys.executable, str(RECIPES / f"{name}.py"), *shared, *values]
    if subprocess.run(command, env=environ, check=False).returncode:
        raise SystemExit(f"this step failed: {' '.join(command)}")


def _side_by_side(lanes: Sequence[Sequence[Step]], shared: Sequence[str], processes: int) -> None:
    """Runs each lane's steps one after another, and up to `processes` lanes at once."""

    def follow(lane: int) -> None:
        for step in lanes[lane]:
            _step(step, shared, lane % processes)

    with ThreadPoolExecutor(processes) as pool:
        list(pool.map(follow, range(len(lanes))))


def _mean_bonus(config: DictConfig) -> float:
    """What T-STAR's discriminator paid for a success on average, for the control that always pays as much."""
    path = run_path(config.results_dir, config.task.name, "tstar", config.seed) / "metrics.csv"
    paid = pd.read_csv(path)["tsr_on_success"].mean()
    return 0.0 if pd.isna(paid) else round(min(max(float(paid), 0.0), 1.0), 4)


@recipe("assemble")
def main(config: DictConfig) -> None:
    """Runs the steps, two at a time where they do not wait for each other."""
    began, processes = time.perf_counter(), config.processes
    given = HydraConfig.get().overrides.task
    shared = [value for value in given if value.split("=")[0] not in OWN]
    subtasks = [f"subtask={index}" for index in range(config.task.subtasks)]
    kinds = f"kinds=[{config.demonstrations.kind}]"

    _side_by_side([[("make_demonstrations", one, kinds)] for one in subtasks], shared, processes)
    _side_by_side([[("gail_ppo", one)] for one in subtasks], shared, processes)
    skills = [("evaluate", "system=gail_ppo", one) for one in subtasks]
    _side_by_side(
        [
            [("tstar",), ("evaluate", "system=tstar")],
            [
                ("policy_sequencing",),
                ("evaluate", "system=policy_sequencing"),
                ("evaluate", "system=no_finetuning"),
            ],
        ],
        shared,
        processes,
    )
    control = "policy_sequencing_bonus"
    lane = [
        ("policy_sequencing", f"system={control}", f"bonus={_mean_bonus(config)}"),
        ("evaluate", f"system={control}"),
    ]
    _side_by_side([lane, skills], shared, processes)
    _step(("plot",), shared, 0)
    print(f"all of it took {(time.perf_counter() - began) / 60:.1f} minutes")


if __name__ == "__main__":
    main()
