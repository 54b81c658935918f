"""An experiment over made-up tasks, written to a folder as a page of results reads it."""

from pathlib import Path

import numpy as np
import pandas as pd
import yaml

from tstar_rl.analysis import read_experiment
from tstar_rl.analysis.page.contents import read_contents
from tstar_rl.analysis.page.over_tasks import over_tasks

PAPER = {
    "tasks": [],
    "systems": {"tstar": {"label": "T-STAR"}},
    "arms": {"base": "no signal", "tstar": None, "late": "late start"},
    "hours": 48,
    "workers": 16,
}
RUNS = {
    "long": {
        "base": {1: [0.8, 0.4, 0.2, 0.2], 2: [0.6, 0.6, 0.2, 0.2]},
        "tstar": {1: [1, 0.8, 0.6, 0.4], 2: [1, 1, 1, 1]},
    },
    "short": {"base": {1: [0.6, 0.2], 2: [1, 0.6]}, "tstar": {1: [0.6, 0.2], 2: [1, 0.8]}},
}
"""Shares of completed subtasks; progress .4, .4 | .7, 1 of four subtasks and .4, .8 | .4, .9 of two."""


def write_shelf(root: Path, runs: dict) -> Path:
    """An experiment of runs of 20 episodes, by task, arm and seed, that a page shows."""
    for task, arms in runs.items():
        for arm, seeds in arms.items():
            for seed, shares in seeds.items():
                folder = root / "shelf" / task / arm / f"seed{seed}"
                folder.mkdir(parents=True)
                row = {"checkpoint": "last", "mode": "deterministic", "episodes": 20, "seed": seed}
                row |= {"progress": np.mean(shares), "success": shares[-1], "env_steps": 1e6, "minutes": 2}
                row |= {"success_low": 0.0, "success_high": 1.0}
                row |= {f"subtask_{index}": share for index, share in enumerate(shares)}
                pd.DataFrame([row]).to_csv(folder / "evaluation.csv", index=False)
                (folder / "config.yaml").write_text(yaml.safe_dump({"versions": {"commit": "c" * 40}}))
    (root / "shelf" / "README.md").write_text("# The shelf\n\nMade up.\n")
    contents(root, reference="base")
    return root


def contents(root: Path, **more) -> None:
    entry = {"folder": "shelf", "kind": "experiment", **more}
    (root / "contents.yaml").write_text(yaml.safe_dump({"experiments": [entry]}))


def section(root: Path) -> str:
    (entry,) = read_contents(root).experiments
    return over_tasks(read_experiment(root / "shelf"), PAPER, entry)


def add_skills(root: Path, successes: dict[str, list[list[float]]]) -> None:
    """Skills of seeds 1, 2, ... of each task: `successes` has a list for each seed."""
    for task, seeds in successes.items():
        for seed, skills in enumerate(seeds, start=1):
            for index, success in enumerate(skills):
                folder = root / "shelf" / task / "gail_ppo" / f"seed{seed}" / f"subtask{index}"
                folder.mkdir(parents=True)
                line = {
                    "checkpoint": "last",
                    "mode": "deterministic",
                    "episodes": 20,
                    "seed": seed,
                    "minutes": 2,
                }
                line |= {
                    "progress": success,
                    "success": success,
                    "env_steps": 1e6,
                    f"subtask_{index}": success,
                }
                line |= {"success_low": 0.0, "success_high": 1.0}
                pd.DataFrame([line]).to_csv(folder / "evaluation.csv", index=False)
                (folder / "config.yaml").write_text(
                    yaml.safe_dump({"subtask": index, "versions": {"commit": "c" * 40}})
                )
