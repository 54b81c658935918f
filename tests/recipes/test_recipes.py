"""Recipes, run as users run them: the same figures however they are run."""

import shutil

import pandas as pd
import pytest
import torch
import yaml
from recipe_runs import kill_after, metrics, places, run

from tstar_rl.chaining.skill import Skill


@pytest.mark.slow
def test_the_script_is_evaluated_as_policies_are(tmp_path):
    done = run("evaluate_expert", *places(tmp_path, "script"), "subtask=1", "evaluation.episodes=8")
    assert done.returncode == 0, done.stderr
    table = pd.read_csv(tmp_path / "script/results/table_lack/expert/seed0/subtask1/evaluation.csv")
    assert table.loc[0, ["checkpoint", "episodes", "success"]].tolist() == ["script", 8, 1.0]


@pytest.mark.slow
def test_the_shelf_is_evaluated_into_one_table(tmp_path):
    values = ["evaluation.episodes=4", "evaluation.whole_episodes=4", *places(tmp_path, "a")]
    for task in ("chair_bernhard", "table_lack", "chair_bernhard"):
        done = run("evaluate_shelf", f"tasks=[{task}]", "env.velocity_scale=0.4", *values)
        assert done.returncode == 0, done.stderr
    table = pd.read_csv(tmp_path / "a" / "results" / "shelf_scripted.csv")
    assert table.groupby("task").subtask.apply(list).to_dict() == {
        "chair_bernhard": ["0", "1", "whole"], "table_lack": ["0", "1", "2", "3", "whole"]
    }  # fmt: skip
    assert (table.episodes == 4).all() and (table.success >= 0.75).all()


@pytest.mark.slow
def test_baselines_of_the_whole_task_are_made_and_evaluated_once(tmp_path):
    small = ["demonstrations.episodes=4", "demonstrations.num_envs=8", "bc.epochs=1", "ppo.epochs=1"]
    small += ["training.num_envs=8", "training.total_steps=1024", "training.max_steps=25"]
    small += ["training.demonstration_starts=0"]  # the best is told by episodes of its own
    small += ["evaluation.whole_episodes=4", "video=false", f"demonstrations_dir={tmp_path / 'd'}"]
    values = ["scale=whole_quick", "only=[bc_noisy,gail_ppo]", *small, *places(tmp_path, "a")]
    done = run("baselines", *values)
    assert done.returncode == 0, done.stderr
    tables = {}
    for name, checkpoints in (("bc_noisy", {"last"}), ("gail_ppo", {"last", "best"})):
        file = tmp_path / "a" / "results" / "table_lack" / name / "seed0" / "evaluation.csv"
        tables[file] = file.stat().st_mtime_ns
        table = pd.read_csv(file)
        assert set(table.checkpoint) == checkpoints and set(table["mode"]) == {"deterministic", "stochastic"}
        assert {f"subtask_{i}" for i in range(4)} <= set(table.columns) and (table.episodes == 4).all()
    again = run("baselines", *values)
    assert again.returncode == 0, again.stderr
    assert {file: file.stat().st_mtime_ns for file in tables} == tables


@pytest.mark.slow
def test_threads_do_not_change_the_figures(demonstrations, tmp_path):
    for nthread in (1, 2):
        done = run(
            "gail_ppo", "subtask=0", demonstrations, f"nthread={nthread}", *places(tmp_path, str(nthread))
        )
        assert done.returncode == 0, done.stderr
    assert metrics(tmp_path, "1").read_bytes() == metrics(tmp_path, "2").read_bytes()


@pytest.mark.slow
def test_a_killed_run_resumes_to_the_same_figures(demonstrations, tmp_path):
    done = run("gail_ppo", "subtask=0", demonstrations, *places(tmp_path, "whole"))
    assert done.returncode == 0, done.stderr
    values = ["subtask=0", demonstrations, *places(tmp_path, "killed")]
    file = metrics(tmp_path, "killed")
    assert 4 <= kill_after(4, file, "gail_ppo", *values) < 8, "it was not killed in the middle"
    done = run("gail_ppo", *values)
    assert done.returncode == 0, done.stderr
    assert file.read_bytes() == metrics(tmp_path, "whole").read_bytes()


@pytest.mark.slow
def test_a_finished_run_goes_on_to_more_steps_as_if_it_had_had_them(demonstrations, tmp_path):
    """Unless something in it follows the share of its steps that is done: then it is refused, and nothing changes."""
    free = ["subtask=0", demonstrations, "exploration=null"]
    for name, values in (("whole", ["training.total_steps=2048"]), ("longer", [])):
        done = run("gail_ppo", *free, *values, *places(tmp_path, name))
        assert done.returncode == 0, done.stderr
    file = metrics(tmp_path, "longer")
    before = file.read_bytes()
    for values in (["subtask=0", demonstrations], [*free, "ppo.linear_decay=true"]):
        done = run("gail_ppo", *values, *places(tmp_path, "longer"), "training.total_steps=2048")
        assert done.returncode and "keep runs apart" in done.stderr and file.read_bytes() == before
    done = run("gail_ppo", *free, *places(tmp_path, "longer"), "training.total_steps=2048")
    assert done.returncode == 0, done.stderr
    assert file.read_bytes() == metrics(tmp_path, "whole").read_bytes()
    assert yaml.safe_load((file.parent / "config.yaml").read_text())["training"]["total_steps"] == 2048


@pytest.mark.slow
def test_resuming_with_another_config_is_refused(demonstrations, tmp_path):
    values = ["subtask=0", demonstrations, *places(tmp_path, "a")]
    assert run("gail_ppo", *values).returncode == 0
    done = run("gail_ppo", *values, "ppo.epochs=7")
    assert done.returncode and "ppo.epochs was 2" in done.stderr and "resume=false" in done.stderr


@pytest.mark.slow
@pytest.mark.timeout(1800)  # a dozen processes: minutes on a machine that does other things
def test_a_killed_chain_resumes_to_the_same_figures(tmp_path):
    demonstrations = f"demonstrations_dir={tmp_path}"
    skills = [demonstrations, "demonstrations.episodes=16", "bc.epochs=40", "training.total_steps=0"]
    place = f"runs_dir={tmp_path / 'whole' / 'runs'}", f"results_dir={tmp_path / 'whole' / 'results'}"
    assert run("make_demonstrations", *skills, "kinds=[noisy]").returncode == 0
    for index in range(4):
        done = run("gail_ppo", *skills, *place, f"subtask={index}")
        assert done.returncode == 0, done.stderr
    (tmp_path / "killed").mkdir()
    shutil.copytree(tmp_path / "whole" / "runs", tmp_path / "killed" / "runs")

    chain = [
        demonstrations,
        "demonstrations.episodes=16",
        "chain.rounds=1",
        "chain.steps_per_turn=512",
        "chain.trial_episodes=8",
    ]
    files, chains = {}, {}
    for name in ("whole", "killed"):
        values = [*chain, *places(tmp_path, name)]
        files[name] = tmp_path / name / "results" / "table_lack" / "tstar" / "seed0" / "metrics.csv"
        if name == "killed":
            assert 9 <= kill_after(9, files[name], "tstar", *values) < 16, "it was not killed in the middle"
        done = run("tstar", *values)
        assert done.returncode == 0, done.stderr
        best = tmp_path / name / "runs" / "table_lack" / "tstar" / "seed0" / "best"
        chains[name] = [Skill.load(best / f"skill{index}").network_state() for index in range(4)]
    assert files["whole"].read_bytes() == files["killed"].read_bytes()
    assert pd.read_csv(files["whole"]).trial_progress.notna().sum() == 4
    torch.testing.assert_close(chains["whole"], chains["killed"], rtol=0, atol=0)
