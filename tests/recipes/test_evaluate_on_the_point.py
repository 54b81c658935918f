"""The figures that `evaluate.py` writes, of chains on the point whose outcomes are known."""

import math

import pandas as pd
import pytest

from tstar_rl.chaining.chain import save_chain
from tstar_rl.chaining.recovery import RecoverySettings
from tstar_rl.env import furniture_env
from tstar_rl.env.task_tables import furniture_digest
from tstar_rl.runs.run_config import read_config, write_config
from tstar_rl.seeds import evaluation_seed

SEED = 5
WORLD = {"velocity_scale": 0.4, "gripper": "sign", "preassembled": "jitter"}
"""Of the laptop scale."""
SETTINGS = ("+env.max_steps=20", "evaluation.whole_episodes=64", "video=false", f"seed={SEED}")


@pytest.fixture
def evaluated(call, tmp_path):
    """The rows of a saved chain's evaluation, by checkpoint and mode."""

    def run(*values: str) -> pd.DataFrame:
        places = [f"{place}_dir={tmp_path / place}" for place in ("results", "runs")]
        call("evaluate", "system=tstar", *SETTINGS, *places, *values)
        table = pd.read_csv(tmp_path / f"results/table_lack/tstar/seed{SEED}/evaluation.csv")
        return table.set_index(["checkpoint", "mode"])

    return run


def test_each_checkpoint_has_its_own_figures_from_episodes_of_the_runs_seed(
    point_skills, evaluated, tmp_path, worlds
):
    """In the best chain the first skill ends where y > 0."""
    run = tmp_path / f"runs/table_lack/tstar/seed{SEED}"
    save_chain(point_skills, run / "last")
    point_skills[0].policy[0][1].module[0][-1].bias.data[1] = 3.0
    save_chain(point_skills, run / "best")
    rows = evaluated("modes=[deterministic,stochastic]")
    last, best = (rows.success[name, "deterministic"] for name in ("last", "best"))
    assert 0.25 < last < 0.75 and best > 0.9
    modes = [(64, None, evaluation_seed(SEED, mode, None)) for mode in ("deterministic", "stochastic")]
    assert [world[:3] for world in worlds] == modes * 2 and modes[0] != modes[1]


def test_a_shorter_chain_ends_with_its_last_link(point_skills, evaluated, tmp_path):
    """In the best chain the first skill ends where y > 0, and two subtasks take some six steps."""
    run = tmp_path / f"runs/table_lack/tstar/seed{SEED}"
    save_chain(point_skills[:2], run / "last")
    point_skills[0].policy[0][1].module[0][-1].bias.data[1] = 3.0
    save_chain(point_skills[:2], run / "best")
    rows = evaluated("modes=[deterministic]")
    row, best = (rows.loc[(name, "deterministic")] for name in ("last", "best"))
    assert row.success == row.subtask_1 and row.progress == pytest.approx((1 + row.subtask_1) / 2)
    assert math.isnan(row.subtask_2) and 0.25 < row.success < 0.75
    longest = 7 * best.success + 20 * (1 - best.success)  # a failed episode has 20 steps
    assert best.success > 0.9 and best.episode_length < longest, "it goes on with what it has no skill for"


def test_a_checkpoint_that_is_another_ones_copy_is_not_run_again(point_skills, evaluated, tmp_path):
    for name in ("last", "best"):
        save_chain(point_skills, tmp_path / f"runs/table_lack/tstar/seed{SEED}" / name)
    rows = evaluated("modes=[deterministic]").drop(columns=["minutes", "env_steps"])
    assert rows.loc["last"].equals(rows.loc["best"])


def test_a_chain_that_was_saved_with_recovery_goes_home_at_the_worlds_speed(
    point_skills, evaluated, tmp_path, monkeypatch
):
    """Every hand-over is drawn to go home: a step back, to where the skill before was not done yet."""
    asked = []

    def home(observation, velocity_scale):
        asked.append(velocity_scale)
        back = observation.new_zeros(len(observation), 9)
        back[:, 0] = -1.0
        return back, observation[:, 0] % 1 > 0.5

    monkeypatch.setattr("tstar_rl.config.recovery.way_home", home)
    recovery = {"settings": vars(RecoverySettings()), "shares": [1.0] * 3}
    save_chain(point_skills, tmp_path / f"runs/table_lack/tstar/seed{SEED}/last", recovery=recovery)
    rows = evaluated("modes=[deterministic]", "checkpoints=[last]", "env.velocity_scale=0.4")
    row = rows.loc["last", "deterministic"]
    begun = (
        1 + 2 * row.subtask_1
    )  # each skill but the first, where the one before it succeeded: the first always does
    assert row.homings == pytest.approx(begun) and set(asked) == {0.4}


def test_a_chain_is_not_evaluated_as_one_of_another_world(point_skills, say, tmp_path):
    """As where runs_dir is given and results_dir is forgotten: the tables there are of another chain, and stay."""
    save_chain(
        point_skills, tmp_path / f"runs/table_lack/tstar/seed{SEED}/last", env=WORLD | {"velocity_scale": 0.3}
    )
    table = tmp_path / f"results/table_lack/tstar/seed{SEED}/evaluation.csv"
    table.parent.mkdir(parents=True)
    table.write_text("checkpoint,mode,seed,progress\nlast,deterministic,5,0.9\n")
    values = [f"{place}_dir={tmp_path / place}" for place in ("results", "runs")]
    told = say("evaluate", "system=tstar", *SETTINGS, *values)
    assert "skill0 was trained in another world: env.velocity_scale was 0.3 when it was saved" in told
    assert "0.9" in table.read_text() and [path.name for path in table.parent.iterdir()] == [table.name]


@pytest.mark.parametrize(
    ("recipe", "table"), [("evaluate", "tstar/seed5/evaluation.csv"), ("hand_over", "hand_over.csv")]
)
def test_a_damaged_table_is_told_before_anything_is_measured(
    point_skills, say, tmp_path, monkeypatch, recipe, table
):
    save_chain(point_skills, tmp_path / f"runs/table_lack/tstar/seed{SEED}/last", env=WORLD)
    path = tmp_path / "results/table_lack" / table
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("seed,success\n0,0.")
    monkeypatch.setattr(furniture_env, "FurnitureEnv", None)  # no episode can be run
    values = [f"{place}_dir={tmp_path / place}" for place in ("results", "runs")]
    system = "system=tstar" if recipe == "evaluate" else "systems=[tstar]"
    said = (
        (*SETTINGS[2:], "+env.max_steps=20") if recipe == "evaluate" else (SETTINGS[-1], "+env.max_steps=20")
    )
    assert f"{path} is damaged (its last line has no end)" in say(recipe, system, *said, *values)
    assert path.read_text() == "seed,success\n0,0."


def test_skills_of_another_file_of_furniture_are_refused(point_skills, say, tmp_path):
    save_chain(
        point_skills, tmp_path / f"runs/table_lack/tstar/seed{SEED}/last", env=WORLD, furniture="0" * 64
    )
    values = [f"{place}_dir={tmp_path / place}" for place in ("results", "runs")]
    told = say("evaluate", "system=tstar", *SETTINGS, *values)
    assert (
        "skill0 was trained when table_lack.yaml said something else: train it again (resume=false)" in told
    )


def test_skills_are_chained_as_they_are_in_their_own_world_unless_it_may_differ(
    point_skills, call, say, tmp_path
):
    """Each says which that is, or, saved by an older version, the config of its results does."""
    for index, skill in enumerate(point_skills):
        place = f"table_lack/gail_ppo/seed{SEED}/subtask{index}"
        said = {"env": WORLD | {"arm_noise": 0.1}} if index == 2 else {}
        skill.save(tmp_path / "runs" / place / "last", **said)
    write_config(tmp_path / "results" / place, {"env": WORLD | {"reset_robot": False}})
    values = ["system=no_finetuning", "modes=[deterministic]", "checkpoints=[last]", *SETTINGS]
    values += [f"{each}_dir={tmp_path / each}" for each in ("results", "runs")]
    assert "subtask2/last was trained in another world: env.arm_noise was 0.1" in say("evaluate", *values)
    told = say("evaluate", *values, "demonstrations.may_differ=[arm_noise]")
    assert "subtask3/last was trained in another world: env.reset_robot was False" in told
    call("evaluate", *values, "demonstrations.may_differ=[arm_noise,reset_robot]")
    noted = read_config(tmp_path / f"results/table_lack/no_finetuning/seed{SEED}")
    assert noted["furniture"] == furniture_digest("table_lack")
    assert (tmp_path / f"results/table_lack/no_finetuning/seed{SEED}/evaluation.csv").is_file()
