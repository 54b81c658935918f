"""`export.py` writes what other libraries read, and `bc.py` learns from what it wrote."""

import re
import shutil
from dataclasses import replace

import h5py
import numpy as np
import pandas as pd
import pytest
from omegaconf import OmegaConf
from recipe_runs import load_recipe, run
from recorded import as_demonstrations, make, scripted

from tstar_rl.chaining.chain import save_chain
from tstar_rl.chaining.skill import Skill
from tstar_rl.config.build import load_skill
from tstar_rl.demonstrations.formats import not_reproduced, read_hdf5, write_hdf5
from tstar_rl.models.network_settings import NetworkSettings
from tstar_rl.rollouts.episodes import same_policy
from tstar_rl.runs.run_config import write_config
from tstar_rl.runs.run_folder import run_path

QUICK = ["scale=quick", "task=chair_ingolf", "subtask=1", "bc.epochs=2", "env.velocity_scale=1.0"]
QUICK += ["env.preassembled=ideal"]


def test_demonstrations_go_out_and_come_back_and_so_do_episodes(call, tmp_path, monkeypatch, capsys):
    minari = pytest.importorskip("minari")
    monkeypatch.delenv("MINARI_DATASETS_PATH", raising=False)
    own = replace(as_demonstrations(scripted()), noise=0.15)
    own.save(tmp_path / "demonstrations/quick/chair_ingolf/seed0/subtask1_noisy.npz")
    call("export", *QUICK, "demonstrations.episodes=2")
    told = capsys.readouterr().out
    path = tmp_path / "exports/chair_ingolf/noisy_seed0/subtask1.hdf5"
    assert f"{path.relative_to(tmp_path)}: played again from its states, 2 of 2 the same to the bit" in told
    recording = read_hdf5(path)
    assert [one.succeeded for one in recording.episodes] == [True, True] and recording.noise == 0.15
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "exports/minari"))
    dataset = minari.load_dataset("tstar/chair_ingolf/subtask1_noisy_seed0-v0")
    assert np.array_equal(dataset[1].observations, recording.episodes[1].observations)

    for system, values in (("bc", []), ("bc_mine", [f"demonstrations.file={path.parent}"])):
        call("bc", *QUICK, f"system={system}", "demonstrations.episodes=2", *values)
    bc, mine = (run_path("runs/quick", "chair_ingolf", name, 0, 1) / "last" for name in ("bc", "bc_mine"))
    assert same_policy(load_skill(bc).policy, load_skill(mine).policy)  # the labels came back to the bit too

    values = ["episodes=2", "formats=[hdf5]", "mode=stochastic", "+env.max_steps=6"]
    call("export", *QUICK, f"path={mine}", *values)
    assert "2 episodes, of which 0 succeeded" in capsys.readouterr().out
    again = read_hdf5(tmp_path / "exports/chair_ingolf/bc_mine_seed0_last_stochastic/subtask1.hdf5")
    assert again.made_by == "bc_mine_seed0_last, stochastic" and again.arguments["max_steps"] == 6
    assert [len(one) for one in again.episodes] == [6, 6]
    assert not (again.episodes[0].observations[0] == again.episodes[1].observations[0]).all()


@pytest.mark.parametrize("whole_folder", [True, False])
def test_a_user_s_demonstrations_are_no_script_s_and_leave_the_script_s_alone(
    call, tmp_path, whole_folder, monkeypatch
):
    minari = pytest.importorskip("minari")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))
    as_demonstrations(scripted()).save(
        tmp_path / "demonstrations/quick/chair_ingolf/seed0/subtask1_noisy.npz"
    )
    values = [*QUICK, "demonstrations.episodes=2", "check=false"]
    call("export", *values)
    exports = tmp_path / "exports/chair_ingolf"
    before = (exports / "noisy_seed0/subtask1.hdf5").read_bytes()
    mine = write_hdf5(scripted(), tmp_path / "by hand, 2.0/subtask1.hdf5")
    folder, said = ("by_hand_2_0", "by hand, 2.0/subtask1.hdf5") if whole_folder else ("subtask1", mine.name)
    call("export", *values, f"demonstrations.file='{mine.parent if whole_folder else mine}'")
    assert (exports / "noisy_seed0/subtask1.hdf5").read_bytes() == before
    assert read_hdf5(exports / f"imported_{folder}/subtask1.hdf5").made_by == f"imported from {said}"
    assert len(minari.load_dataset(f"tstar/chair_ingolf/subtask1_imported_{folder}-v0")) == 2


def test_episodes_of_a_chain_with_recovery_are_not_made_without_it(call, tmp_path):
    skills = [Skill("chair_ingolf", index, NetworkSettings(hidden=(8,))) for index in range(2)]
    save_chain(skills, tmp_path / "chain", recovery={"settings": {}, "shares": [1.0]})
    with pytest.raises(
        SystemExit, match="chain is a chain with recovery, which evaluate.py and ways_home.py alone"
    ):
        call("export", *QUICK, f"path={tmp_path / 'chain'}", "episodes=2", "formats=[hdf5]")


def test_a_chain_of_one_skill_of_four_is_no_whole_chain(say, tmp_path):
    save_chain([Skill("chair_ingolf", 0, NetworkSettings(hidden=(8,)))], tmp_path / "chain")
    told = say("export", *QUICK, f"path={tmp_path / 'chain'}", "episodes=2", "formats=[hdf5]")
    assert "chain is a chain of 1 of 4 skills, whose episodes do not end with it" in told


def test_episodes_of_a_run_are_of_the_world_that_it_was_trained_in(call, say, tmp_path):
    run = run_path("runs/quick", "chair_ingolf", "bc", 0, 1)
    results = tmp_path / run_path("runs/quick/results", "chair_ingolf", "bc", 0, 1)
    Skill("chair_ingolf", 1, NetworkSettings(hidden=(8,))).save(tmp_path / run / "last")
    write_config(results, {"env": {"velocity_scale": 0.4}})
    values = [*QUICK, "episodes=1", "formats=[hdf5]", "check=false", "+env.max_steps=2"]
    told = say("export", *values, f"path={run / 'last'}")
    assert "results/chair_ingolf/bc/seed0/subtask1 has the results of something else: " in told
    assert "env.velocity_scale was 0.4 when it was saved, and is 1.0 now" in told
    elsewhere = say("export", "task=chair_ingolf", "subtask=1", f"path={run / 'last'}")
    assert "last is of task=quick, but task=chair_ingolf is asked for: give the scale" in elsewhere
    for other, got in (("subtask=0", "subtask=0 whole=false"), ("subtask=null", "subtask=None whole=true")):
        asked = [*values, other, f"path={run / 'last'}", f"runs_dir={tmp_path / 'none'}"]
        told = say("export", *asked, "whole=true") if "null" in other else say("export", *asked)
        assert f"is of subtask1; got {got}" in told
    assert not (tmp_path / "exports").exists()
    for path in ("mine", "runs/quick/mine"):  # of no run: nothing says what its world was
        shutil.copytree(tmp_path / run / "last", tmp_path / path)
        call("export", *values, f"path={path}")
        file = tmp_path / "exports/chair_ingolf/mine/subtask1.hdf5"
        before = file.read_bytes()
        told = say("export", *values, f"path={path}", "env.max_steps=3")
        assert (
            "mine/subtask1.hdf5 is of another world: max_steps was 2 when it was saved, and is 3 now. Give"
            in told
        )
        assert file.read_bytes() == before
        shutil.rmtree(tmp_path / "exports")


def test_a_data_set_of_another_world_is_not_replaced(call, say, tmp_path, monkeypatch):
    """One folder of data sets may be that of two exports_dir. Nothing is written then, in the other format neither."""
    minari = pytest.importorskip("minari")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))
    Skill("chair_ingolf", 1, NetworkSettings(hidden=(8,))).save(tmp_path / "mine")
    values = [*QUICK, "episodes=1", "check=false", "path=mine"]
    call("export", *values, "+env.max_steps=2")
    told = say("export", *values, "+env.max_steps=3", "exports_dir=elsewhere")
    assert (
        "subtask1_mine-v0 is of another world: max_steps was 2 when it was saved, and is 3 now. Give" in told
    )
    assert minari.load_dataset("tstar/chair_ingolf/subtask1_mine-v0").total_steps == 2
    assert not (tmp_path / "elsewhere").exists()


def test_an_episode_that_differs_is_told(call, tmp_path, monkeypatch, capsys):
    """As on another processor: the file's rewards are not those of this simulator."""
    module = load_recipe("export")
    path = write_hdf5(scripted(max_steps=4), tmp_path / "a.hdf5")
    with h5py.File(path, "r+") as file:
        file["data/demo_1/rewards"][2] += 1.0
    assert list(not_reproduced(make(max_steps=4), read_hdf5(path))) == [1]
    config = OmegaConf.create(
        {"demonstrations": {"num_envs": 4}, "nthread": 1, "device": "cpu", "physics": None}
    )
    told = module._played_again(path, config)
    assert re.search(r"1 of 2 differ; demo_1: rewards differs from step 2 on, by 1 at most", told)


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        (
            "export",
            ["subtask=0"],
            "no demonstrations at demonstrations/.*make them first .*make_demonstrations.py task=",
        ),
        ("export", ["formats=[hdf6]"], "formats must be of hdf5, minari; got 'hdf6'"),
        ("export", ["mode=best"], "mode must be one of deterministic, stochastic; got 'best'"),
        ("export", ["episodes=0"], "episodes must be a whole number from 1, got 0"),
        ("export", ["episodes=10"], "episodes=10 is of path=.* without it demonstrations go out: give path="),
        ("export", ["mode=stochastic"], "mode=stochastic is of path=.* and mode=... out"),
        ("export", ["path=nowhere"], "no skill and no chain at nowhere"),
        (
            "bc",
            ["subtask=0", "demonstrations.file=none.hdf5"],
            "no demonstrations at none.hdf5: an HDF5 file",
        ),
        (
            "gail_ppo",
            ["subtask=0", "demonstrations.file=3"],
            "demonstrations.file must be text or null, got 3",
        ),
    ],
)
def test_a_mistake_is_told_in_words(say, name, values, message):
    assert re.search(message, say(name, *values))


def test_a_user_s_broken_file_is_told_in_words(say, tmp_path):
    path = write_hdf5(scripted(max_steps=3), tmp_path / "mine.hdf5")
    values = ["subtask=1", "task=chair_ingolf", f"demonstrations.file={path}"]
    assert re.search("mine.hdf5: demo_0 did not succeed; .*filter_key=successes", say("bc", *values))
    path.write_bytes(path.read_bytes()[:1000])
    assert re.search("mine.hdf5 cannot be read .damaged, truncated or not HDF5", say("bc", *values))


@pytest.mark.slow
def test_gail_and_a_chain_take_a_user_s_files_too(tmp_path):
    folders = [f"{name}_dir={tmp_path / name}" for name in ("runs", "results", "demonstrations")]
    values = [*folders, "task=chair_bernhard"]
    assert run("make_demonstrations", *values, "kinds=[noisy]").returncode == 0
    done = run("export", *values, "formats=[hdf5]", f"exports_dir={tmp_path}")
    assert done.returncode == 0 and done.stdout.count("4 of 4 the same to the bit") == 2, done.stderr
    values += [
        f"demonstrations.file={tmp_path / 'chair_bernhard' / 'noisy_seed0'}",
        "demonstrations.kind=plain",
    ]
    for subtask in (0, 1):
        done = run("gail_ppo", *values, f"subtask={subtask}")
        assert done.returncode == 0, done.stderr
    done = run("tstar", *values, "chain.rounds=1", "chain.steps_per_turn=512", "chain.trial_episodes=8")
    assert done.returncode == 0, done.stderr
    table = pd.read_csv(tmp_path / "results/chair_bernhard/tstar/seed0/metrics.csv")
    assert len(table) > 2 and table.f_phi_loss_discriminator.notna().all()
