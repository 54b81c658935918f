"""What the steps of a pipeline leave behind, without running them."""

import copy
import functools
import os
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
from omegaconf import DictConfig
from recorded import leave_demonstrations

from tstar_rl.config.values import plain
from tstar_rl.launch import steps
from tstar_rl.launch.steps import step_files
from tstar_rl.runs.run_config import write_config

SUBTASKS = 4


def places(folder: Path) -> list[str]:
    return [f"{name}_dir={folder / name}" for name in ("results", "runs", "demonstrations")]


def composed(step: tuple[str, ...], shared: Sequence[str] = ()) -> DictConfig:
    """As `step_config`, once for all tests of a process: it takes most of the time of those that fake what steps do."""
    return copy.deepcopy(_composed(tuple(step), tuple(shared)))


_composed = functools.cache(steps.step_config)


def finish(
    step: tuple[str, ...], shared: Sequence[str], at: int, modes: tuple[str, ...] | None = None
) -> None:
    """Leaves behind what a step does, written `at` some second."""
    config = steps.step_config(step, shared)
    for file in step_files(step, config):
        file.parent.mkdir(parents=True, exist_ok=True)
        if step[0] == "evaluate":
            number = (
                config.evaluation.whole_episodes if config.subtask is None else config.evaluation.episodes
            )
            rows = [
                {"checkpoint": "last", "mode": mode, "seed": config.seed, "episodes": number}
                for mode in modes or config.modes
            ]
            pd.DataFrame(rows).to_csv(file, index=False)
        elif step[0] == "make_demonstrations":
            leave_demonstrations(file, plain(config))
        else:
            file.write_text("{}")
            (file.parent / "last").mkdir(exist_ok=True)
        os.utime(file, (at, at))
    if step[0] not in ("evaluate", "make_demonstrations"):
        results = Path(config.results_dir) / step_files(step, config)[0].parent.relative_to(config.runs_dir)
        write_config(results, plain(config))
