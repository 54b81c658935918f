"""Which checkpoints `evaluate.py` is asked for by a path or a system, and what their training took."""

import json
import math
import os
from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir

from tstar_rl.chaining.chain import save_chain
from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.values import CONFIGS, plain
from tstar_rl.launch.asked_checkpoints import find_checkpoints, spent_on
from tstar_rl.launch.run_folders import check_skills_stay, of_an_earlier_training
from tstar_rl.models.network_settings import NetworkSettings
from tstar_rl.runs.csv_tables import append_rows
from tstar_rl.runs.mismatch import CheckpointMismatchError
from tstar_rl.runs.run_config import write_config

CHAIN = ["last/skill0", "last/skill1"]


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


def places(*given: str):
    """The config as the path changes it, where the table goes, and what is evaluated, by checkpoint."""
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/evaluate", list(given))
    results, found = find_checkpoints(config, given)
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
def test_system_and_seed_are_those_of_the_path(made, given):
    config, results, found = places(*(value.format(here=made) for value in given))
    assert (config.system, config.seed, config.subtask) == ("tstar", 1, None)
    assert results.resolve() == made / "results" / "table_lack" / "tstar" / "seed1"
    assert list(found) == ["last"]
    run = made / "runs" / "table_lack" / "tstar" / "seed1"
    assert [folder.resolve() for folder in found["last"].folders] == [run / one for one in CHAIN]
    assert spent_on(config, results, found["last"]) == {"env_steps": 1020, "minutes": 102}


@pytest.mark.parametrize("results", ["results/gpu", "runs/quick/results", "runs"])
def test_results_may_lie_anywhere(made, results):
    runs = made / ("runs/quick" if "quick" in results else "runs")
    save(runs, 2)
    where = [f"results_dir={results}", f"runs_dir={runs}"]
    for path in (
        f"{results}/table_lack/gail_ppo/seed2/subtask1",
        f"{runs}/table_lack/gail_ppo/seed2/subtask1/last",
    ):
        config, place, found = places(f"path={path}", *where)
        assert (config.system, config.seed, config.subtask) == ("gail_ppo", 2, 1)
        assert place == Path(results, "table_lack/gail_ppo/seed2/subtask1")
        assert [folder.resolve() for folder in found["last"].folders] == [
            runs / "table_lack" / "gail_ppo" / "seed2" / "subtask1" / "last"
        ]


def test_skills_chained_as_they_are_have_results_but_no_run(made):
    path = "results/table_lack/no_finetuning/seed1"
    config, results, found = places(f"path={path}", "chain.links=2")
    skills = [Path(f"runs/table_lack/gail_ppo/seed1/subtask{index}/last") for index in range(2)]
    assert results == Path(path) and found == {"last": (skills, True)}
    assert spent_on(config, results, found["last"]) == {"env_steps": 20, "minutes": 2}


def test_a_path_that_is_one_checkpoint_is_of_no_other(made):
    last = "path=runs/table_lack/tstar/seed1/last"
    assert list(places(last, "checkpoints=[last]")[2]) == ["last"]
    assert list(places(last.removesuffix("/last"), "checkpoints=[last]")[2]) == ["last"]
    with pytest.raises(ValueError, match=r"is one checkpoint: leave out checkpoints, got \['best'\]"):
        places(last, "checkpoints=[best]")


def test_one_skill_of_a_chain_and_a_folder_of_no_run(made):
    config, results, found = places("path=runs/table_lack/tstar/seed1/last/skill1")
    assert config.seed == 1 and list(found) == ["skill1"] and not found["skill1"].chain
    assert results == Path("results/table_lack/tstar/seed1/last")
    assert all(map(math.isnan, spent_on(config, results, found["skill1"]).values())), "of all skills' turns"
    (made / "runs" / "table_lack" / "tstar" / "seed1").rename(made / "mine")
    config, results, found = places("path=mine/last", "seed=3")
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
        (["path=runs/table_lack"], "a run lies at <task>/<system>/seed<k>"),
        (
            ["path=runs/table_lack/tstar/seed7"],
            "no skill and no chain at runs/table_lack/tstar/seed7/last or .* seed=7",
        ),
    ],
)
def test_another_run_than_asked_for_is_refused(made, given, message):
    with pytest.raises((ValueError, FileNotFoundError), match=message):
        places(*given)


def test_a_chain_took_what_its_skills_had_taken_when_it_began_with_them(made):
    config, results, found = places("path=runs/table_lack/tstar/seed1/last")
    write_config(results, plain(config) | {"skills_took": {"env_steps": 7, "minutes": 0.5}})
    assert spent_on(config, results, found["last"]) == {"env_steps": 1007, "minutes": 100.5}
    with pytest.raises(
        CheckpointMismatchError, match="took 7 steps in 0.500 minutes; .* now took 20 in 2.000"
    ):
        check_skills_stay(config, results, 2)
    write_config(results, plain(config) | {"skills_took": {"env_steps": 20, "minutes": 2}})
    check_skills_stay(config, results, 2)
    write_config(results, plain(config))  # an older chain, which noted nothing
    check_skills_stay(config, results, 2)


def test_a_chain_in_no_runs_folder_is_not_charged_with_the_skills_of_a_seed(made):
    (made / "runs/table_lack/tstar/seed1").rename(made / "mine")
    config, results, found = places("path=mine/last", "seed=0")
    assert all(map(math.isnan, spent_on(config, results, found["last"]).values()))
    write_config(results, {"skills_took": {"env_steps": 7, "minutes": 0.5}})
    assert spent_on(config, results, found["last"]) == {"env_steps": 1007, "minutes": 100.5}


@pytest.mark.parametrize("system", ["tstar", "no_finetuning", "gail_ppo"])
def test_a_copy_of_an_evaluation_whose_times_are_other_ones_is_of_the_training_beside_it(made, system):
    subtask = ["subtask=1"] if system == "gail_ppo" else []
    config, results, found = places(f"system={system}", "seed=1", "task.subtasks=2", *subtask)
    row = spent_on(config, results, found["last"]) | {"seed": 1}
    table = results / "evaluation.csv"
    append_rows(table, [row], ("seed",))
    os.utime(table, (1, 1))
    assert not of_an_earlier_training(table, config)
    append_rows(table, [row | {"minutes": row["minutes"] + 1e-3}], ("seed",))
    assert not of_an_earlier_training(table, config), "it was written after the runs had ended"
    os.utime(table, (1, 1))
    assert of_an_earlier_training(table, config)
    append_rows(table, [{"seed": 1}], ("seed",))
    os.utime(table, (1, 1))
    assert of_an_earlier_training(table, config), "it does not say what it took"


def test_a_run_below_folders_of_its_own_is_asked_for_with_these(made):
    save(made / "runs/no_return", 1)
    told = "lies in no_return of .*/runs: give .* runs_dir=runs/no_return results_dir=results/no_return"
    with pytest.raises(InvalidValueError, match=told):
        places("path=runs/no_return/table_lack/tstar/seed1/last")
    save(made / "runs/quick", 1)
    with pytest.raises(InvalidValueError, match="lies in quick of .*: give the folders .* with, scale=quick"):
        places("path=runs/quick/table_lack/tstar/seed1/last")
    own = ["runs_dir=runs/no_return", "results_dir=results/no_return"]
    config, *_ = places("path=runs/no_return/table_lack/tstar/seed1/last", *own)
    assert (config.system, config.seed) == ("tstar", 1)
