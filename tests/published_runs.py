"""Rows and folders of published results, written by hand, and what the paper says beside them."""

from pathlib import Path
from typing import Any

import pandas as pd
import yaml

THEIRS = {
    "tasks": ["table"],
    "systems": {
        "bc": {"label": "BC", "progress": {"table": [0.03, 0.0]}},
        "tstar": {"label": "T-STAR", "progress": {"table": [0.9, 0.07]}, "success": {"table": 0.87}},
        "ours_alone": {"label": "never run"},
    },
    "arms": {"buffer": "buffer starts", "tstar": None},
    "arm_endings": {"_no_gate": "every turn kept", "_paper_schedule": "as in the paper"},
    "hours": 48,
    "workers": 16,
}
COMMIT = "c" * 40


def evaluation(recipe: str, seed: int, progress: float, checkpoint: str = "last", **more) -> dict:
    row = {"task": "table", "recipe": recipe, "seed": seed, "subtask": -1, "checkpoint": checkpoint}
    return {**row, "mode": "deterministic", "progress": progress, "success": progress, **more}


def write(root: Path, experiment: str, recipe: str, seed: int, progress: float, **more) -> None:
    """A run of 200 episodes that all complete one of two subtasks, or `progress` of both; `columns` are added."""
    folder = root / experiment / "table" / recipe / f"seed{seed}"
    folder.mkdir(parents=True)
    rows = []
    for checkpoint in ("last", "best"):
        row = evaluation(recipe, seed, progress, checkpoint, success_low=0.0, success_high=1.0, env_steps=5e5)
        row |= {"minutes": 1, "episodes": 200, "subtask_0": progress, "subtask_1": progress}
        row |= more.get("columns", {})
        rows.append({name: value for name, value in row.items() if name not in ("task", "recipe", "subtask")})
    pd.DataFrame(rows).to_csv(folder / "evaluation.csv", index=False)
    (folder / "config.yaml").write_text(yaml.safe_dump({"versions": {"commit": more.get("commit", COMMIT)}}))


def contents(root: Path, experiments: list[dict], **more: Any) -> None:
    (root / "contents.yaml").write_text(yaml.safe_dump({"experiments": experiments, **more}))
