"""The script for a GPU, at tiny sizes without one: it stops when its time is over, and another call goes on."""

import pandas as pd
import pytest
from test_recipes import places, run

CHAIN = ["chain.steps_per_turn=256", "chain.trial_episodes=8", "chain.whole_trial_episodes=4"]


@pytest.mark.slow
@pytest.mark.timeout(4200)  # a dozen processes a call
def test_slices_go_on_from_one_another_until_all_is_done(tmp_path):
    values = ["scales=[quick]", "device=cpu", *CHAIN, *places(tmp_path, "a")]
    values += [f"demonstrations_dir={tmp_path}", "evaluation.episodes=4", "evaluation.whole_episodes=4"]

    results = tmp_path / "a" / "results"
    for minutes in (0.05, 0.3):  # not even the demonstrations, and some skill or other
        stopped = run("gpu_run", f"minutes={minutes}", *values)
        assert stopped.returncode == 75, stopped.stderr
    assert not (results / "table_lack" / "tstar" / "seed0" / "evaluation.csv").exists()
    done = run("gpu_run", "minutes=60", *values)
    assert done.returncode == 0, done.stderr
    assert "scale=quick" in done.stdout
    table = pd.read_csv(results / "table_lack" / "tstar" / "seed0" / "evaluation.csv")
    assert set(table.checkpoint) == {"last", "best"} and (table.episodes == 4).all()
    assert pd.read_csv(results / "table_lack" / "tstar" / "seed0" / "metrics.csv")["round"].max() == 0
    minutes = pd.read_csv(results / "gpu_run.csv").set_index("step")["minutes"]
    assert {"tstar", "evaluate system=tstar video=false", "gail_ppo subtask=3"} <= set(minutes.index)

    files = {file: file.stat().st_mtime_ns for file in results.rglob("metrics.csv")}
    assert run("gpu_run", *values).returncode == 0
    assert {file: file.stat().st_mtime_ns for file in results.rglob("metrics.csv")} == files
