"""The rows of the bench: what each is held against, the fronts alone, a chain, and what assemble.py took."""

from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
import torch
from hydra import compose, initialize_config_dir

from tstar_envs.physics.cpu import CpuPhysics
from tstar_rl.config.values import CONFIGS
from tstar_rl.env.furniture_env import FurnitureEnv
from tstar_rl.rollouts.collection import with_starts

RECIPES = Path(__file__).resolve().parents[2] / "recipes"
SMALL_CHAIN = [
    "demonstrations.episodes=4",
    "demonstrations.num_envs=4",
    "bc.epochs=1",
    "training.num_envs=4",
    "training.horizon=8",
    "chain.links=2",
    "chain.steps_per_turn=64",
    "chain.seed_episodes=4",
    "chain.trial_episodes=4",
    "chain.trial_max_steps=4",
]


@pytest.fixture(autouse=True)
def _recipes(monkeypatch):
    monkeypatch.syspath_prepend(RECIPES)


def test_a_rate_is_held_against_the_bare_simulator_under_its_policy():
    from bench import rows_of

    rates = {"bare": [90.0, 100.0, 500.0], "bare_policy": [50.0], "env": [80.0]}
    rates |= {"bare_train": [50.0], "train": [40.0]}
    rows = {row["measure"]: row for row in rows_of(rates)}
    assert rows["env"] == {
        "measure": "env", "value": 80.0, "unit": "environment steps / s", "ratio_to_bare": 0.8
    }  # fmt: skip
    assert rows["train"]["ratio_to_bare"] == 0.8 and rows["bare_policy"]["ratio_to_bare"] == 1.0


def test_one_simulation_has_its_milliseconds_and_its_rate():
    from bench import rows_of

    rows = {row["measure"]: row for row in rows_of({"bare_single": [2000.0], "single_dm": [250.0]})}
    assert (rows["single_dm"]["value"], rows["single_dm"]["unit"]) == (4.0, "ms / step")
    assert (rows["single_dm_rate"]["value"], rows["single_dm_rate"]["ratio_to_bare"]) == (250.0, 0.125)
    assert rows["bare_single"]["value"] == 0.5


@pytest.mark.slow
def test_no_front_of_one_simulation_is_faster_than_its_simulator():
    from bench_bare import single_rates

    rates = single_rates("table_lack", 0, 200, seed=0)
    assert rates.keys() == {"single_gymnasium", "single_dm", "bare_single"}
    assert 0 < rates["single_dm"] < rates["bare_single"]
    assert 0 < rates["single_gymnasium"] < rates["bare_single"]


def test_a_chain_learns_from_the_steps_of_its_turns(tmp_path):
    import bench_chain

    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/tstar", [*SMALL_CHAIN, "chain.rounds=3"])
        assert bench_chain._learned_from(config, 2) == 3 * 2 * 64
        rates = bench_chain.chain_rates(SMALL_CHAIN, rounds=1, steps=2)
    assert rates.keys() == {"bare_chain", "chain"} and min(rates.values()) > 0


@pytest.mark.slow
def test_what_a_user_waits_for():
    from bench_start import start_rows

    rows = list(start_rows([*SMALL_CHAIN[:5]]))
    assert [row["measure"] for row in rows] == ["help_seconds", "mistake_seconds", "first_rollout_seconds"]
    answer, mistake, rollout = (row["value"] for row in rows)
    assert 0 < max(answer, mistake) < rollout / 2, "an answer waits for TorchRL"


def test_the_minutes_of_the_pipeline_are_those_of_one_seed_of_the_task_and_scale(tmp_path):
    from assemble import _note_minutes
    from bench import assemble_row

    values = [f"results_dir={tmp_path}"]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config, pipeline = (compose(f"recipe/{name}", values) for name in ("bench", "assemble"))
    assert list(assemble_row(config, "laptop", [])) == []
    older = pd.DataFrame([{"task": "table_lack", "seeds": 1, "processes": 2, "minutes": 99.0}])
    older.to_csv(tmp_path / "assemble.csv", index=False)  # of a version that noted no scale
    assert list(assemble_row(config, "laptop", [])) == []
    for run in (("laptop", 1, 30.0), ("laptop", 1, 21.456), ("laptop", 3, 60.0), ("quick", 1, 1.0)):
        _note_minutes(pipeline, *run)
    table = pd.read_csv(tmp_path / "assemble.csv")
    assert table["minutes"].tolist() == [
        99.0,
        21.46,
        60.0,
        1.0,
    ]  # the second run of one seed stands for the first
    (row,) = assemble_row(config, "laptop", [])
    assert row == {"measure": "assemble_minutes", "value": 21.46, "unit": "minutes"}


@pytest.mark.slow
def test_simulations_are_shared_out_among_processes(tmp_path):
    from bench_growth import measured

    values = ["growth.steps=2", "growth.least=1"]
    one, two = (measured(values, 4, processes, 1) for processes in (1, 2))
    assert (one["num_envs"], two["num_envs"], two["processes"]) == (4, 4, 2)
    assert one["steps_per_second"] > 0 and one["setup_seconds"] > 0
    assert two["megabytes"] > 1.5 * one["megabytes"]  # each process has its own Python and torch


@pytest.mark.slow
def test_a_process_that_fails_is_said_to_have():
    from bench_growth import measured

    with pytest.raises(RuntimeError, match="2 simulations ended early"):
        measured(["subtask=99"], 2, 1, 1)


def test_memory_has_ten_rows_over_all_rollouts():
    from bench_growth import memory

    values = ["growth.rollouts=20", "growth.rollout_envs=2", "growth.rollout_horizon=4"]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        rows = list(memory(compose("recipe/bench_growth", values)))
    assert [row["rollouts"] for row in rows] == list(range(2, 21, 2))
    assert rows[0]["megabytes"] > 50


def test_torchrl_s_wrapper_around_dm_control_steps():
    from bench_wrapped import wrapped_rate

    assert wrapped_rate("toy_table", 1, 2) > 0


def test_a_bare_simulator_that_is_told_the_same_ends_in_the_same_states():
    """Over episodes that end after five steps and begin anew, drawing new starts."""
    from bench_bare import random_policy, replay

    env = with_starts(FurnitureEnv("table_lack", 4, subtask=0, nthread=1, seed=0, max_steps=5))
    world: Any = env.base_env.world
    told = replay(env, partial(random_policy, torch.Generator().manual_seed(0)), 12)
    assert len(told.controls) == 12
    assert [restart is not None for restart in told.restarts] == [step % 5 == 0 for step in range(12)]
    bare = CpuPhysics(world.model, 4, 1)
    assert told.tell(bare) > 0
    torch.testing.assert_close(
        bare.qpos, world.physics.qpos, rtol=0, atol=1e-4
    )  # a restart forgets sleep timers
    world.step(torch.zeros(4, 9))
    assert len(told.controls) == 12  # nobody listens any more
