"""Recipes run by tests: as processes, as users run them, or in this process where only what they do is tested."""

import importlib.util
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest
from hydra._internal.hydra import Hydra
from hydra.types import RunMode

from tstar_rl.config.command_line import FULL_ERROR, HINT

ROOT = Path(__file__).resolve().parents[1]
SMALL = [
    "scale=quick",
    "progress_bar=false",
    "demonstrations.episodes=4",
    "demonstrations.num_envs=8",
    "bc.epochs=2",
    "training.num_envs=8",
    "training.horizon=16",
    "training.total_steps=1024",
    "training.checkpoint_every=256",
    "ppo.minibatch=64",
]


def command(recipe: str, *values: str) -> list[str]:
    return [sys.executable, str(ROOT / "recipes" / f"{recipe}.py"), *values]


def environ() -> dict[str, str]:
    path = os.pathsep.join([str(ROOT), str(ROOT / "envs")])
    return {**os.environ, "PYTHONPATH": path, "OMP_NUM_THREADS": "1"}


def run(recipe: str, *values: str, small: bool = True) -> subprocess.CompletedProcess[str]:
    """Runs a recipe as a process, with `SMALL` before its values, from a folder that it must leave empty."""
    called = command(recipe, *(SMALL if small else ()), *values)
    with tempfile.TemporaryDirectory() as empty:
        done = subprocess.run(called, env=environ(), cwd=empty, capture_output=True, text=True, check=False)
        left = sorted(path.name for path in Path(empty).iterdir() if path.name != "MUJOCO_LOG.TXT")
    assert not left, f"{recipe} wrote outside the folders that it was given: {left}"
    return done


def kill_after(rows: int, file: Path, recipe: str, *values: str) -> int:
    """Starts a recipe and kills it once its table has that many rows; returns how many it then has."""
    process = subprocess.Popen(command(recipe, *SMALL, *values), env=environ())
    while process.poll() is None and (not file.is_file() or len(file.read_text().splitlines()) <= rows):
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    return len(file.read_text().splitlines()) - 1


def places(folder: Path, name: str) -> list[str]:
    return [f"results_dir={folder / name / 'results'}", f"runs_dir={folder / name / 'runs'}"]


def metrics(folder: Path, name: str) -> Path:
    """The table of a skill of subtask 0 whose folders are those of `places`."""
    return folder / name / "results" / "table_lack" / "gail_ppo" / "seed0" / "subtask0" / "metrics.csv"


def load_recipe(name: str):
    """A recipe as a module."""
    spec = importlib.util.spec_from_file_location(f"recipe_{name}", ROOT / "recipes" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def demonstrations(tmp_path_factory) -> str:
    """The value that names a folder with demonstrations of subtask 0."""
    place = f"demonstrations_dir={tmp_path_factory.mktemp('demonstrations')}"
    done = run("make_demonstrations", "subtask=0", "kinds=[noisy]", place)
    assert done.returncode == 0, done.stderr
    return place


@pytest.fixture
def call(monkeypatch, tmp_path):
    """Calls a recipe in this process with a command line, from an empty folder; returns its module."""
    monkeypatch.delenv(FULL_ERROR, raising=False)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        Hydra, "get_mode", lambda *_, **__: RunMode.RUN
    )  # for which it composes the config once more

    def run(name: str, *values: str, module=None):
        monkeypatch.setattr(sys, "argv", [f"{name}.py", "progress_bar=false", *values])
        module = module or load_recipe(name)
        module.main()
        return module

    return run


@pytest.fixture
def say(call):
    """Gives the message that a recipe ends with."""

    def run(name: str, *values: str) -> str:
        with pytest.raises(SystemExit) as ended:
            call(name, *values)
        assert FULL_ERROR not in os.environ
        message = ended.value.code
        assert isinstance(message, str) and message.endswith(f"\n{HINT}") and message.count("\n") == 1
        return message.removesuffix(f"\n{HINT}")

    return run
