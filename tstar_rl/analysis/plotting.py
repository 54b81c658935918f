"""Curves and tables from what runs leave behind. Reads CSV files alone, so notebooks need nothing else."""

from collections.abc import Iterable
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import pandas as pd
from matplotlib import pyplot as plt

from tstar_rl.runs.run_folder import read_run_path

__all__ = ["evaluation_table", "learning_curves", "read_evaluations", "read_metrics"]


def _read(root: str | Path, name: str) -> pd.DataFrame:
    root = Path(root)
    files = [
        file for depth in ("*/*/seed*", "*/*/seed*/subtask*") for file in sorted(root.glob(f"{depth}/{name}"))
    ]
    frames = [_read_one(file, root) for file in files]
    return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame()


def _read_one(file: Path, root: Path) -> pd.DataFrame:
    """The table of a run, with its task, recipe, seed and subtask (-1: none)."""
    table, (place, _) = pd.read_csv(file), read_run_path(file.relative_to(root))
    seeds = set(table.get("seed", ())) - {place.seed}
    if seeds:
        others = ", ".join(map(str, sorted(seeds)))
        raise ValueError(
            f"{file} has rows of seed {others}: they are another run's; delete them and evaluate that run"
        )
    subtask = -1 if place.subtask is None else place.subtask
    return table.assign(task=place.task, recipe=place.system, seed=place.seed, subtask=subtask)


def read_metrics(root: str | Path = "results") -> pd.DataFrame:
    """Every metrics.csv below `root`, with columns task, recipe, seed, subtask (-1 for a chain) added."""
    return _read(root, "metrics.csv")


def read_evaluations(root: str | Path = "results") -> pd.DataFrame:
    """Every evaluation.csv below `root`, with the same columns added.

    Raises:
        ValueError: if a table has rows of another seed than its folder's.
    """
    return _read(root, "evaluation.csv")


def evaluation_table(
    evaluations: pd.DataFrame, checkpoint: str = "last", mode: str = "deterministic"
) -> pd.DataFrame:
    """Mean over seeds of each recipe's whole-task evaluation."""
    chosen = evaluations[(evaluations.subtask == -1) & (evaluations.checkpoint == checkpoint)]
    chosen = chosen[chosen["mode"] == mode]
    shares = [name for name in chosen.columns if name.startswith("subtask_")]
    columns = ["progress", "success", "success_low", "success_high", *shares, "env_steps", "minutes"]
    table = chosen.groupby(["task", "recipe"])[columns].mean()
    table.insert(0, "seeds", chosen.groupby(["task", "recipe"]).seed.nunique())
    return table


def learning_curves(
    metrics: pd.DataFrame, path: str | Path, columns: Iterable[str] = ("success_rate", "episode_length", "kl")
) -> Path:
    """One panel for each column that was logged, one line for each recipe, subtask and seed; writes a PNG.

    Raises:
        ValueError: if none was.
    """
    wanted = list(columns)
    columns = [name for name in wanted if name in metrics and metrics[name].notna().any()]
    if not columns:
        raise ValueError(f"none of {', '.join(wanted)} was logged; there are {', '.join(metrics.columns)}")
    figure, panels = plt.subplots(1, len(columns), figsize=(5 * len(columns), 4), squeeze=False)
    by = ["recipe", "subtask", "seed"] + (["skill"] if "skill" in metrics else [])
    for panel, column in zip(panels[0], columns, strict=True):
        for place, rows in metrics.groupby(by, dropna=False):
            rows = rows.dropna(subset=[column])
            names = [f"{k} {int(v)}" for k, v in zip(by[1:], place[1:], strict=True) if float(v) >= 0]
            panel.plot(rows.env_steps, rows[column], label=" ".join([str(place[0]), *names]), linewidth=1)
        panel.set(xlabel="environment steps", title=column.replace("_", " "))
        panel.grid(alpha=0.3)
    panels[0][0].legend(fontsize=7)
    figure.tight_layout()
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)
    plt.close(figure)
    return Path(path)
