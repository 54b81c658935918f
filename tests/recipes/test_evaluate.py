"""What `evaluate.py` evaluates and where its rows go."""

import json
import os
from pathlib import Path

import pandas as pd
import pytest
import torch
import yaml
from hydra import compose, initialize_config_dir
from recipe_runs import load_recipe

from tstar_rl.chaining.chain import ChainPolicy, save_chain
from tstar_rl.chaining.skill import NetworkSettings, Skill
from tstar_rl.config.values import CONFIGS

CHAIN = ["last/skill0", "last/skill1"]


@pytest.fixture(scope="module")
def recipe():
    return load_recipe("evaluate")


@pytest.fixture
def made(tmp_path, monkeypatch):
    """Runs of two seeds below runs/ of the working directory: a chain, and the skills that it began with."""
    monkeypatch.chdir(tmp_path)
    for seed in (0, 1):
        save(tmp_path / "runs", seed)
    return tmp_path


def save(runs: Path, seed: int) -> None:
    """A chain of two skills and the two it began with; what each took tells them apart."""
    skills = [Skill("table_lack", index, NetworkSettings(hidden=(8,), std="fixed")) for index in range(2)]
    chain = runs / "table_lack" / "tstar" / f"seed{seed}"
    save_chain(skills, chain / "last")
    (chain / "finished.json").write_text(json.dumps({"env_steps": 1000, "minutes": 100 * seed}))
    for index, skill in enumerate(skills):
        place = runs / "table_lack" / "gail_ppo" / f"seed{seed}" / f"subtask{index}"
        skill.save(place / "last")
        (place / "finished.json").write_text(json.dumps({"env_steps": 10, "minutes": seed}))


def places(recipe, *given: str):
    """The config as the path changes it, where the table goes, and what is evaluated, by checkpoint."""
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/evaluate", list(given))
    results, found = recipe._places(config, given)
    return config, results, found


@pytest.mark.parametrize(
    "given",
    [
        ["path=runs/table_lack/tstar/seed1/last"],
        ["path=runs/table_lack/tstar/seed1"],
        ["path=results/table_lack/tstar/seed1"],
        ["path={here}/runs/table_lack/tstar/seed1/last"],
        ["path={here}/results/table_lack/tstar/seed1", "seed=1"],
        ["path=runs/../results/table_lack/tstar/seed1", "system=tstar"],
        ["path=runs/table_lack/tstar/seed1/last", "results_dir={here}/results", "runs_dir={here}/runs"],
    ],
)
def test_system_and_seed_are_those_of_the_path(recipe, made, given):
    config, results, found = places(recipe, *(value.format(here=made) for value in given))
    assert (config.system, config.seed, config.subtask) == ("tstar", 1, None)
    assert results.resolve() == made / "results" / "table_lack" / "tstar" / "seed1"
    assert list(found) == ["last"]
    run = made / "runs" / "table_lack" / "tstar" / "seed1"
    assert [folder.resolve() for folder in found["last"].folders] == [run / one for one in CHAIN]
    assert recipe._spent(config, "gail_ppo", found["last"]) == {"env_steps": 1020, "minutes": 102}


@pytest.mark.parametrize("results", ["results/gpu", "runs/quick/results", "runs"])
def test_results_may_lie_anywhere(recipe, made, results):
    runs = made / ("runs/quick" if "quick" in results else "runs")
    save(runs, 2)
    where = [f"results_dir={results}", f"runs_dir={runs}"]
    for path in (
        f"{results}/table_lack/gail_ppo/seed2/subtask1",
        f"{runs}/table_lack/gail_ppo/seed2/subtask1/last",
    ):
        config, place, found = places(recipe, f"path={path}", *where)
        assert (config.system, config.seed, config.subtask) == ("gail_ppo", 2, 1)
        assert place == Path(results, "table_lack/gail_ppo/seed2/subtask1")
        assert [folder.resolve() for folder in found["last"].folders] == [
            runs / "table_lack" / "gail_ppo" / "seed2" / "subtask1" / "last"
        ]


def test_skills_chained_as_they_are_have_results_but_no_run(recipe, made):
    path = "results/table_lack/no_finetuning/seed1"
    config, results, found = places(recipe, f"path={path}", "chain.links=2")
    skills = [Path(f"runs/table_lack/gail_ppo/seed1/subtask{index}/last") for index in range(2)]
    assert results == Path(path) and found == {"last": (skills, True)}
    assert recipe._spent(config, "gail_ppo", found["last"]) == {"env_steps": 20, "minutes": 2}


@pytest.mark.parametrize(("system", "steps"), [("tstar", 1010), ("no_finetuning", 10)])
def test_a_chain_of_one_skill_is_evaluated_as_a_chain(recipe, made, system, steps):
    """It is the whole of a piece of one step, whose pipeline looks for as many episodes as a whole piece has."""
    skill = Skill("table_lack", 0, NetworkSettings(hidden=(8,), std="fixed"))
    save_chain([skill], made / "runs/table_lack/tstar/seed1/last")
    values = [f"system={system}", "seed=1", "task.subtasks=1"]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/evaluate", values)
    found = recipe._candidates(config, values)[1]["last"]
    assert (found.subtask, found.links) == (None, 1) and isinstance(found.policy, ChainPolicy)
    assert found.spent["env_steps"] == steps  # of the skill's own training, too
    one = places(recipe, "path=runs/table_lack/tstar/seed1/last/skill0")[2]
    assert not one["skill0"].chain


def test_a_path_that_is_one_checkpoint_is_of_no_other(recipe, made):
    last = "path=runs/table_lack/tstar/seed1/last"
    assert list(places(recipe, last, "checkpoints=[last]")[2]) == ["last"]
    assert list(places(recipe, last.removesuffix("/last"), "checkpoints=[last]")[2]) == ["last"]
    with pytest.raises(ValueError, match=r"is one checkpoint: leave out checkpoints, got \['best'\]"):
        places(recipe, last, "checkpoints=[best]")


def test_one_skill_of_a_chain_and_a_folder_of_no_run(recipe, made):
    config, results, found = places(recipe, "path=runs/table_lack/tstar/seed1/last/skill1")
    assert config.seed == 1 and list(found) == ["skill1"]
    assert results == Path("results/table_lack/tstar/seed1/last")
    (made / "runs" / "table_lack" / "tstar" / "seed1").rename(made / "mine")
    config, results, found = places(recipe, "path=mine/last", "seed=3")
    assert config.seed == 3 and results == Path("mine")
    assert found == {"last": ([Path("mine", one) for one in CHAIN], True)}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["path=runs/table_lack/tstar/seed1/last", "seed=0"], "is of seed=1, but seed=0 is asked for"),
        (["path=results/table_lack/tstar/seed1", "system=bc"], "is of system=tstar, but system=bc is asked"),
        (["path=runs/table_lack/gail_ppo/seed1/subtask0", "subtask=1"], "of subtask=0, but subtask=1"),
        (
            ["path=runs/table_lack/tstar/seed1", "task=chair_ingolf"],
            "of task=table_lack, but task=chair_ingolf",
        ),
        (["path=runs/table_lack"], "a run lies at <task>/<recipe>/seed<k>"),
        (
            ["path=runs/table_lack/tstar/seed7"],
            "no skill and no chain at runs/table_lack/tstar/seed7/last or .* seed=7",
        ),
    ],
)
def test_another_run_than_asked_for_is_refused(recipe, made, given, message):
    with pytest.raises((ValueError, FileNotFoundError), match=message):
        places(recipe, *given)


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
    assert films <= {"first_failure.mp4"}  # where this machine can draw
    assert "first failure" in (folder / "episodes.html").read_text() and len(list(folder.glob("*.html"))) == 1


def test_a_table_that_is_not_written_leaves_a_note_of_its_world(recipe, call, tmp_path, monkeypatch):
    """The other way round a kill between the two would leave rows that pass for those of any world."""
    place = Path("table_lack/mine/seed4/subtask2")
    Skill("table_lack", 2, NetworkSettings(hidden=(8,), std="fixed")).save(tmp_path / "runs" / place / "last")
    values = ["modes=[deterministic]", "evaluation.episodes=2", "evaluation.recorded=0", "+env.max_steps=5"]
    values += [f"runs_dir={tmp_path / 'runs'}", f"results_dir={tmp_path / 'results'}"]

    def killed(*given):
        raise KeyboardInterrupt

    monkeypatch.setattr(recipe, "append_rows", killed)
    with pytest.raises((KeyboardInterrupt, SystemExit)):
        call("evaluate", f"path={tmp_path / 'runs' / place}", *values, module=recipe)
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
