"""What is noted of each way home: on episodes written by hand, and by the recipe on the point's chain."""

import math
import runpy

import pandas as pd
import pytest
import torch
from hydra import compose, initialize_config_dir
from recipe_runs import ROOT
from tensordict import TensorDict

from tstar_envs.robots import sawyer
from tstar_rl.chaining.chain import save_chain
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.values import CONFIGS
from tstar_rl.env.layout import PARTS, observation_size
from tstar_rl.seams.ways_home import WaysHome

PARTS_OF = {"part": [1, 0], "target": [0, 1]}
"""Subtask 0 moves the second part to the first, subtask 1 the first to the second."""


class Homings:
    """What a chain with recovery tells of its ways home."""

    homings = torch.zeros(1, dtype=torch.int64)


def watched(*steps: dict) -> list[dict]:
    """What is found in one episode whose steps have these values: skill, at (of both parts), homings, completed."""
    policy = Homings()
    watch = WaysHome(policy, PARTS_OF)
    for number, step in enumerate(steps):
        observation = torch.zeros(1, observation_size(2))
        for part, (x, yaw) in enumerate(step.get("at", ((0.0, 0.0), (0.0, 0.0)))):
            begin = PARTS + 7 * part
            observation[0, begin] = x
            half = math.radians(yaw) / 2
            observation[0, begin + 3], observation[0, begin + 6] = math.cos(half), math.sin(half)
        policy.homings = torch.tensor([step.get("homings", 0)])
        done = step.get("done", False)
        now = {"subtask": step["skill"], "step_count": number, "completed": step["skill"], "done": done}
        row = TensorDict({name: torch.tensor([[value]]) for name, value in now.items()}, [1])
        row["observation"] = observation
        row["next"] = TensorDict({"completed": torch.tensor([[step.get("completed", step["skill"])]])}, [1])
        watch(row)
    return watch.table().to_dict("records")


def test_how_far_the_skills_part_has_moved_since_the_skill_took_over():
    (way,) = watched(
        {"skill": 0, "at": ((9.0, 0.0), (9.0, 0.0)), "completed": 1},
        {"skill": 1, "at": ((0.1, 10.0), (0.0, 0.0))},
        {"skill": 1, "at": ((0.4, 40.0), (5.0, 90.0)), "homings": 1},
    )
    assert (way["skill"], way["way"], way["step"], way["succeeded"]) == (1, 0, 2, 0)
    assert (way["part_moved"], way["part_turned"]) == (0.3, 30.0)
    assert (way["target_moved"], way["target_turned"]) == (5.0, 90.0)


def test_a_success_belongs_to_the_last_way_home_before_it():
    found = watched(
        {"skill": 0, "homings": 1},
        {"skill": 0, "homings": 2},
        {"skill": 0, "homings": 2, "completed": 1},
        {"skill": 1, "homings": 3, "completed": 2},
    )
    assert [(way["skill"], way["way"], way["succeeded"]) for way in found] == [
        (0, 0, 0),
        (0, 1, 1),
        (1, 0, 1),
    ]


def test_nothing_is_noted_after_an_episode_is_done():
    assert watched({"skill": 0}, {"skill": 0, "done": True, "homings": 1, "completed": 1}) == []


def test_the_recipe_writes_a_row_for_each_way_home(point_chain, tmp_path, capsys):
    """Home of the arm's second joint is below 0, and there, as y, no skill of the point but the first succeeds."""
    assert sawyer.HOME_QPOS[1] < 0
    point_chain("recover", "chain.seed_episodes=64", "recovery.at_most=1")
    measure(tmp_path, "evaluation.whole_episodes=32")
    table = pd.read_csv(tmp_path / "results/table_lack/recover/seed0/ways_home.csv")
    assert table.way.tolist() == [0] * 32 and table.succeeded.tolist() == [0] * 32
    assert set(table.skill) == {1}
    assert "ways_home.csv" in capsys.readouterr().out


def test_a_chain_without_recovery_is_refused(point_skills, tmp_path):
    save_chain(point_skills, tmp_path / "runs/table_lack/policy_sequencing/seed0/last")
    with pytest.raises(
        InvalidValueError, match="seed0/last is a chain without recovery: its arm never goes home"
    ):
        measure(tmp_path, "system=policy_sequencing", "scale=laptop")


def measure(folder, *values: str) -> None:
    places = [f"{place}_dir={folder / place}" for place in ("results", "runs")]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/ways_home", [*places, "progress_bar=false", *values])
    runpy.run_path(str(ROOT / "recipes/ways_home.py"))["main"].__wrapped__(config)
