"""The script for a GPU, at tiny sizes without one: it stops when its time is over, and another call goes on."""

import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest
from hydra.core.global_hydra import GlobalHydra
from recipe_runs import SMALL, places, run

from tstar_rl.runs import checkpoint

RECIPES = Path(__file__).resolve().parents[2] / "recipes"
CHAIN = ["chain.steps_per_turn=256", "chain.trial_episodes=8", "chain.seed_episodes=8"]


@pytest.mark.slow
@pytest.mark.timeout(4200)  # a dozen processes a call
def test_slices_go_on_from_one_another_until_all_is_done(tmp_path):
    values = [
        "scales=[quick]",
        "device=cpu",
        *SMALL[1:],
        *CHAIN,
        *places(tmp_path, "a"),
    ]  # without scale=quick
    values += [f"demonstrations_dir={tmp_path}", "evaluation.episodes=4", "evaluation.whole_episodes=4"]

    results = tmp_path / "a" / "results"
    short = run("gpu_run", "minutes=0.01", *values, small=False)  # no step is done in less than a second
    assert short.returncode == 1 and "make_demonstrations" in short.stderr, short.stderr
    kind, began = "kinds=[noisy]", time.monotonic()
    made = run("make_demonstrations", "scale=quick", kind, *values[2:], small=False)
    one_step = (time.monotonic() - began) / 60  # on this machine, as busy as it is
    assert made.returncode == 0, made.stderr
    stopped = run("gpu_run", f"minutes={3 * one_step}", *values, small=False)  # some skill or other
    assert stopped.returncode == 75, stopped.stderr
    assert not (results / "table_lack" / "tstar" / "seed0" / "evaluation.csv").exists()
    done = run("gpu_run", "minutes=60", *values, small=False)
    assert done.returncode == 0, done.stderr
    assert "scale=quick" in done.stdout
    table = pd.read_csv(results / "table_lack" / "tstar" / "seed0" / "evaluation.csv")
    assert set(table.checkpoint) == {"last", "best"} and (table.episodes == 4).all()
    assert pd.read_csv(results / "table_lack" / "tstar" / "seed0" / "metrics.csv")["round"].max() == 0
    minutes = pd.read_csv(results / "gpu_run.csv").set_index("step")["minutes"]
    assert {"tstar", "evaluate system=tstar video=false", "gail_ppo subtask=3"} <= set(minutes.index)

    files = {file: file.stat().st_mtime_ns for file in results.rglob("metrics.csv")}
    assert run("gpu_run", *values, small=False).returncode == 0
    assert {file: file.stat().st_mtime_ns for file in results.rglob("metrics.csv")} == files


@pytest.mark.parametrize("leaves", ["nothing", "a log", "a checkpoint", "demonstrations"])
def test_a_step_that_gets_nowhere_in_a_whole_call_is_an_error(leaves, tmp_path, monkeypatch):
    """Faked steps: the demonstrations are there, or come one by one; the step after is stopped by the clock."""
    monkeypatch.syspath_prepend(RECIPES)
    import gpu_run

    from tstar_rl.launch import time_limit

    runs = tmp_path / "a" / "runs" / "table_lack"

    def stopped(step, shared, line, seconds, code):
        first = step[0] == "make_demonstrations"
        if first and leaves != "demonstrations":
            return  # they are there
        place = tmp_path / "table_lack" / "seed0" if first else runs / "gail_ppo" / "seed0" / "subtask0"
        place.mkdir(parents=True, exist_ok=True)
        if leaves == "a log":
            (place / "timing.csv").write_text("env_steps")
        elif leaves == "a checkpoint":
            checkpoint.save_step(place / "checkpoints", 1, {}, {})
        elif leaves == "demonstrations":
            (place / "subtask0_noisy.npz").write_text("")
        raise subprocess.TimeoutExpired("", seconds)

    monkeypatch.setattr(time_limit, "run_recipe", stopped)
    values = ["scales=[quick]", "device=cpu", f"demonstrations_dir={tmp_path}", *places(tmp_path, "a")]
    monkeypatch.setattr(sys, "argv", ["gpu_run.py", *values])
    GlobalHydra.instance().clear()
    with pytest.raises(SystemExit) as end:
        gpu_run.main()
    if leaves in ("nothing", "a log"):
        assert "gail_ppo subtask=0 had all 9 minutes of a call" in str(end.value.code)
    else:
        assert end.value.code == 75
