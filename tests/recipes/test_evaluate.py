"""What `evaluate.py` evaluates and where its rows go."""

import json
import os
from pathlib import Path
from threading import Thread

import pandas as pd
import pytest
import torch
import yaml
from hydra import compose, initialize_config_dir
from omegaconf import OmegaConf
from recipe_runs import load_recipe

from tstar_envs import rendering
from tstar_rl.chaining.chain import ChainPolicy, save_chain
from tstar_rl.chaining.skill import Skill
from tstar_rl.config.values import CONFIGS
from tstar_rl.models.network_settings import NetworkSettings
from tstar_rl.runs.files import turn_to_write


@pytest.fixture(scope="module")
def recipe():
    return load_recipe("evaluate")


@pytest.mark.parametrize(("system", "steps"), [("tstar", 1010), ("no_finetuning", 10)])
def test_a_chain_of_one_skill_is_evaluated_as_a_chain(recipe, tmp_path, monkeypatch, system, steps):
    """It is the whole of a piece of one step, whose pipeline looks for as many episodes as a whole piece has."""
    monkeypatch.chdir(tmp_path)
    skill = Skill("table_lack", 0, NetworkSettings(hidden=(8,), std="fixed"))
    alone, chain = Path("runs/table_lack/gail_ppo/seed1/subtask0"), Path("runs/table_lack/tstar/seed1")
    skill.save(alone / "last")
    save_chain([skill], chain / "last")
    for run, took in ((alone, 10), (chain, 1000)):
        (run / "finished.json").write_text(json.dumps({"env_steps": took, "minutes": 1}))
    values = [f"system={system}", "seed=1", "task.subtasks=1"]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/evaluate", values)
    found = recipe._candidates(config, values)[1]["last"]
    assert (found.subtask, found.links) == (None, 1) and isinstance(found.policy, ChainPolicy)
    assert found.spent["env_steps"] == steps  # of the skill's own training, too


def test_rows_films_and_config_lie_beside_each_other(recipe, call, tmp_path):
    skill = Skill("table_lack", 2, NetworkSettings(hidden=(8,), std="fixed"))
    place = Path("table_lack/mine/seed4/subtask2")
    skill.save(tmp_path / "runs" / place / "last")
    values = ["modes=[deterministic]", "evaluation.episodes=2", "+env.max_steps=5"]
    values += [f"runs_dir={tmp_path / 'runs'}", f"results_dir={tmp_path / 'results'}"]
    call("evaluate", f"path={tmp_path / 'runs' / place}", *values, module=recipe)
    folder = tmp_path / "results" / place
    table = pd.read_csv(folder / "evaluation.csv")
    assert table[["seed", "episodes", "checkpoint"]].values.tolist() == [[4, 2, "last"]]
    config = yaml.safe_load((folder / "config.yaml").read_text())
    assert (config["system"], config["seed"], config["subtask"]) == ("mine", 4, 2)
    assert config["env"]["max_steps"] == 5
    assert torch.__version__.split("+")[0] == config["versions"]["torch"].split("+")[0]  # a build may follow
    films = {path.name for path in folder.glob("*.mp4")}
    assert films == ({"first_failure.mp4"} if rendering.backend() else set())
    assert "first failure" in (folder / "episodes.html").read_text() and len(list(folder.glob("*.html"))) == 1


def test_an_evaluation_whose_films_fail_is_not_lost(recipe, call, tmp_path, monkeypatch):
    place = Path("table_lack/mine/seed4/subtask2")
    Skill("table_lack", 2, NetworkSettings(hidden=(8,), std="fixed")).save(tmp_path / "runs" / place / "last")
    values = ["modes=[deterministic]", "evaluation.episodes=2", "+env.max_steps=5"]
    values += [f"runs_dir={tmp_path / 'runs'}", f"results_dir={tmp_path / 'results'}"]
    monkeypatch.setattr(recipe.Recorder, "write", lambda *_: (_ for _ in ()).throw(OSError(5, "no film")))
    with pytest.raises((OSError, SystemExit)):
        call("evaluate", f"path={tmp_path / 'runs' / place}", *values, module=recipe)
    assert pd.read_csv(tmp_path / "results" / place / "evaluation.csv")["episodes"].tolist() == [2]


def test_a_table_that_is_not_written_leaves_a_note_of_its_world(recipe, call, tmp_path, monkeypatch):
    """The other way round a kill between the two would leave rows that pass for those of any world."""
    place = Path("table_lack/mine/seed4/subtask2")
    Skill("table_lack", 2, NetworkSettings(hidden=(8,), std="fixed")).save(tmp_path / "runs" / place / "last")
    values = ["modes=[deterministic]", "evaluation.episodes=2", "evaluation.recorded=0", "+env.max_steps=5"]
    values += [f"runs_dir={tmp_path / 'runs'}", f"results_dir={tmp_path / 'results'}"]

    kills = []

    def killed(*given):
        kills.append(given)
        raise KeyboardInterrupt

    monkeypatch.setattr(recipe, "append_rows", killed)
    with pytest.raises((KeyboardInterrupt, SystemExit)):
        call("evaluate", f"path={tmp_path / 'runs' / place}", *values, module=recipe)
    assert len(kills) == 1
    config = yaml.safe_load((tmp_path / "results" / place / "config.yaml").read_text())
    assert config["env"]["max_steps"] == 5


def test_rows_of_an_earlier_training_do_not_stand_beside_new_ones(recipe, call, tmp_path):
    """A chain of skills as they are is no run, so nothing else deletes its table when its skills are trained anew."""
    skill = Skill("table_lack", 2, NetworkSettings(hidden=(8,), std="fixed"))
    place = Path("table_lack/mine/seed4/subtask2")
    skill.save(tmp_path / "runs" / place / "last")
    values = [
        f"path={tmp_path / 'runs' / place}",
        "evaluation.episodes=2",
        "evaluation.recorded=0",
        "+env.max_steps=5",
    ]
    values += [f"runs_dir={tmp_path / 'runs'}", f"results_dir={tmp_path / 'results'}"]
    table = tmp_path / "results" / place / "evaluation.csv"
    for mode in ("deterministic", "stochastic"):
        call("evaluate", *values, f"modes=[{mode}]", module=recipe)
    assert pd.read_csv(table)["mode"].tolist() == ["deterministic", "stochastic"]
    ended = tmp_path / "runs" / place / "finished.json"
    ended.write_text(json.dumps({"env_steps": 10, "minutes": 1}))
    os.utime(ended, (later := table.stat().st_mtime + 10, later))
    call("evaluate", *values, "modes=[stochastic]", module=recipe)
    assert pd.read_csv(table)["mode"].tolist() == ["stochastic"]


def test_an_older_table_is_looked_at_and_dropped_in_one_step(recipe, monkeypatch, tmp_path):
    """Another evaluation may have written its own in the meantime: that one stays."""
    config = OmegaConf.create({"pretrained": None})
    table, looked = tmp_path / "evaluation.csv", []
    table.write_text("old")
    monkeypatch.setattr(recipe, "run_folder", lambda *_: tmp_path)
    monkeypatch.setattr(
        recipe, "of_an_earlier_training", lambda *_: looked.append(table.read_text()) or looked == ["old"]
    )
    other = Thread(target=recipe._forget_older, args=(table, config))
    with turn_to_write(tmp_path):
        other.start()
        other.join(0.3)
        assert other.is_alive() and not looked
        table.write_text("new")
    other.join()
    assert looked == ["new"] and table.read_text() == "new"
