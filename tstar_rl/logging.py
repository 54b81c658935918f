"""What a run leaves behind: a table of metrics, its config, checkpoints to resume from, and a progress bar.

`results/<task>/<recipe>/seed<k>[/subtask<i>]/` holds what is kept (config.yaml, metrics.csv, evaluation.csv);
`runs/` mirrors it with what is large or depends on the machine (checkpoints, skills, timing.csv).
"""

import json
import math
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pandas as pd
from torchrl.checkpoint import GlobalRNGState
from tqdm import tqdm

from tstar_rl import checkpoint

__all__ = ["MetricsLog", "Run", "append_rows", "run_path"]

MACHINE_ONLY = (
    "nthread",
    "resume",
    "results_dir",
    "runs_dir",
    "demonstrations_dir",
    "progress_bar",
    "evaluation",
)
"""Config values that do not change what a run computes."""


class MetricsLog:
    """A CSV file that grows by rows.

    Args:
        path: of the file. What is there is kept until `truncate`.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.columns: list[str] = []
        self.rows = 0

    def append(self, row: Mapping[str, Any]) -> None:
        """Adds one row and flushes it to disk. A name that is new becomes a column, empty in the rows before."""
        new = [name for name in row if name not in self.columns]
        if new and self.rows:
            table = pd.read_csv(self.path, dtype=str, keep_default_na=False)
            table.assign(**dict.fromkeys(new, "")).to_csv(self.path, index=False)
        self.columns += new
        frame = pd.DataFrame([row], columns=self.columns)
        frame.to_csv(self.path, mode="a" if self.rows else "w", header=not self.rows, index=False)
        self.rows += 1

    def truncate(self, rows: int) -> None:
        """Keeps the first `rows` rows; the columns are those of the file."""
        if rows == 0:
            self.path.unlink(missing_ok=True)
            self.columns, self.rows = [], 0
            return
        lines = self.path.read_text().splitlines(keepends=True)
        if len(lines) < rows + 1:
            raise ValueError(f"{self.path} has {len(lines) - 1} rows, but its checkpoint counts {rows}")
        self.path.write_text("".join(lines[: rows + 1]))
        self.columns, self.rows = lines[0].strip().split(","), rows


def run_path(root: str | Path, task: str, recipe: str, seed: int, subtask: int | None = None) -> Path:
    """<root>/<task>/<recipe>/seed<k>[/subtask<i>]."""
    path = Path(root) / task / recipe / f"seed{seed}"
    return path if subtask is None else path / f"subtask{subtask}"


def append_rows(path: str | Path, rows: list[dict[str, Any]], key: tuple[str, ...]) -> pd.DataFrame:
    """Writes rows into a CSV table, in the place of rows with the same values of `key`; returns the table."""
    path, new = Path(path), pd.DataFrame(rows)
    if path.is_file():
        old = pd.read_csv(path)
        same = old.set_index(list(key)).index.isin(new.set_index(list(key)).index)
        new = pd.concat([old[~same], new], ignore_index=True) if not same.all() else new
    path.parent.mkdir(parents=True, exist_ok=True)
    new.to_csv(path, index=False)
    return new


def _versions() -> dict[str, str]:
    names = ("torch", "torchrl", "tensordict", "mujoco", "tstar-rl")
    found: dict[str, str] = {"python": sys.version.split()[0]}
    for name in names:
        try:
            found[name] = version(name)
        except ModuleNotFoundError:
            found[name] = "not installed"
    commit = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, check=False)
    return {**found, "commit": commit.stdout.strip() or "unknown"}


class Run:
    """Log, progress bar and checkpoints of one run of a recipe.

    Args:
        config: plain values; recorded, and compared when resuming.
        subtask: that the run trains, or None.
        total: environment steps, for the bar.

    Raises:
        CheckpointMismatchError: when resuming a run that had another config.
    """

    def __init__(self, config: Mapping[str, Any], subtask: int | None = None, total: int = 0) -> None:
        place = (config["task"]["name"], config["system"], config["seed"], subtask)
        self.results, self.work = (
            run_path(config["results_dir"], *place),
            run_path(config["runs_dir"], *place),
        )
        self.record = {name: value for name, value in config.items() if name not in MACHINE_ONLY}
        self.record["subtask"] = subtask
        self.config, self.total = config, total
        self.env_steps, self.seconds, self.turn = 0, 0.0, 0
        self.recent, self.best, self.improved = 0.0, 0.0, False
        self.components: dict[str, Any] = {}
        self.metrics, self.timing = (
            MetricsLog(self.results / "metrics.csv"),
            MetricsLog(self.work / "timing.csv"),
        )
        self._last_save, self._clock = 0, time.perf_counter()
        label = config["system"] if subtask is None else f"{config['system']} {subtask}"
        self.bar = tqdm(
            total=total,
            desc=label,
            unit="step",
            unit_scale=True,
            disable=not config["progress_bar"],
        )

    def start(self, **components: Any) -> int:
        """Names what a checkpoint holds, resumes from one if there is one, and returns the steps done so far."""
        self.components = {**components, "run": self, "rng": GlobalRNGState()}
        found = checkpoint.latest(self.work / "checkpoints") if self.config["resume"] else None
        if found is None:
            shutil.rmtree(self.work / "checkpoints", ignore_errors=True)
            self.metrics.truncate(0)
            self.timing.truncate(0)
            self._write_config()
        else:
            try:
                checkpoint.load(found, self.components, **self.record)
            except checkpoint.CheckpointMismatchError as error:
                raise checkpoint.CheckpointMismatchError(f"{error} (resume=false starts over)") from error
        self.bar.update(self.env_steps - self.bar.n)
        self._clock = time.perf_counter()
        return self.env_steps

    def log(self, env_steps: int, **row: Any) -> None:
        """Adds a row at `env_steps` and moves the bar."""
        now = time.perf_counter()
        steps = env_steps - self.env_steps
        self.seconds, self._clock = self.seconds + now - self._clock, now
        self.env_steps = env_steps
        self._follow(row.get("success_rate", float("nan")))
        self.metrics.append({"env_steps": env_steps, **row})
        self.timing.append({"env_steps": env_steps, "minutes": self.seconds / 60, "steps": steps})
        self.bar.update(env_steps - self.bar.n)
        self.bar.set_postfix(success=f"{self.recent:.2f}")

    def _follow(self, success_rate: float) -> None:
        """Running mean of the success in training, and whether it has just been the best so far."""
        if not math.isnan(success_rate):
            self.recent += 0.2 * (success_rate - self.recent)
        self.improved = self.recent > self.best
        self.best = max(self.best, self.recent)

    def save_if_due(self, every: int) -> None:
        """Writes a checkpoint if `every` environment steps have gone by since the last one.

        Whatever can `settle` does so first, in a run that goes on just as in one that is resumed.
        """
        if self.env_steps - self._last_save < every:
            return
        self._last_save = self.env_steps
        for component in self.components.values():
            if hasattr(component, "settle"):
                component.settle()
        checkpoint.save_step(self.work / "checkpoints", self.env_steps, self.components, self.record)

    def state_dict(self) -> dict[str, Any]:
        """Where the log stands."""
        rows = {"metrics": self.metrics.rows, "timing": self.timing.rows}
        return {
            "env_steps": self.env_steps,
            "seconds": self.seconds,
            **rows,
            "last_save": self._last_save,
        } | {
            "turn": self.turn,
            "recent": self.recent,
            "best": self.best,
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Goes back to where the log stood: rows written since are dropped."""
        self.env_steps, self.seconds = int(state["env_steps"]), float(state["seconds"])
        self._last_save, self.turn = int(state["last_save"]), int(state["turn"])
        self.recent, self.best = float(state["recent"]), float(state["best"])
        self.metrics.truncate(int(state["metrics"]))
        self.timing.truncate(int(state["timing"]))

    def finish(self) -> None:
        """Closes the bar and notes that the run is complete."""
        self.bar.close()
        (self.work / "finished.json").write_text(
            json.dumps({"env_steps": self.env_steps, "minutes": self.seconds / 60})
        )

    def _write_config(self) -> None:
        import yaml

        self.results.mkdir(parents=True, exist_ok=True)
        kept = {**self.config, "versions": _versions()}
        (self.results / "config.yaml").write_text(yaml.safe_dump(kept, sort_keys=False))
