"""The queue of a declared experiment with its steps faked."""

import sys
from pathlib import Path

import pytest
from finished_steps import composed
from hydra.core.global_hydra import GlobalHydra

from tstar_rl.launch import steps, time_limit
from tstar_rl.launch.side_by_side import Step

ROOT = Path(__file__).resolve().parents[2]
ONE = ["experiment=shelf", "tasks=[chair_agne]", "seeds=[310]", "processes=1"]


@pytest.fixture
def queue(tmp_path, monkeypatch):
    """Runs the recipe in an empty folder with a made-up `run_recipe`; returns the steps that it took."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(ROOT / "recipes")
    import experiment

    for module in (experiment, steps):
        monkeypatch.setattr(module, "step_config", composed)

    def code_of(commit: str, folder: Path) -> Path:
        """A folder that has its name and our configs."""
        place = tmp_path / "code" / commit
        place.mkdir(parents=True, exist_ok=True)
        if not (place / "configs").exists():
            (place / "configs").symlink_to(ROOT / "configs")
        return place

    def call(*values: str, takes=lambda step: None) -> list[tuple[Step, float | None, Path | None]]:
        taken = []

        def run_recipe(step, shared, line, seconds, code):
            taken.append((step, seconds, code))
            takes(step)

        monkeypatch.setattr(time_limit, "run_recipe", run_recipe)
        monkeypatch.setattr(experiment, "code_of_commit", code_of)
        monkeypatch.setattr(sys, "argv", ["experiment.py", *ONE, *values])
        GlobalHydra.instance().clear()
        experiment.main()
        return taken

    return call
