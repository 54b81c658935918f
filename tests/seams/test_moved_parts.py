"""What is noted of each hand-over: on episodes written by hand, and by the recipe on the point's chain."""

import math
import re
import runpy

import pandas as pd
import pytest
import torch
from hydra import compose, initialize_config_dir
from recipe_runs import ROOT
from tensordict import TensorDict

from tstar_rl.chaining.chain import save_chain
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.values import CONFIGS
from tstar_rl.env.layout import PARTS, observation_size
from tstar_rl.seams.moved_parts import MovedParts, success_by_moved

PLACE = "runs/table_lack/policy_sequencing/seed0"
PARTS_OF = {"part": [1, 0], "target": [0, 1]}
"""Subtask 0 moves the second part to the first, subtask 1 the first to the second."""


def observation(*parts: tuple[float, float]) -> torch.Tensor:
    """Two parts, each at x (m), turned about z by so many degrees."""
    state = torch.zeros(observation_size(2))
    for part, (x, yaw) in enumerate(parts):
        begin, half = PARTS + 7 * part, math.radians(yaw) / 2
        state[begin], state[begin + 3], state[begin + 6] = x, math.cos(half), math.sin(half)
    return state


def watched(*steps: dict) -> list[dict]:
    """What is found of episodes whose steps have these values, one of each episode: skill, at (of both parts), more."""
    watch = MovedParts(PARTS_OF)
    for number, step in enumerate(steps):
        episodes = len(step["skill"])
        row = TensorDict(batch_size=[episodes])
        row["observation"] = torch.stack([observation(*at) for at in step["at"]])
        row["subtask"] = row["completed"] = torch.tensor(step["skill"]).unsqueeze(-1)
        row["step_count"] = torch.full((episodes, 1), number)
        row["done"] = torch.tensor(step.get("done", [False] * episodes)).unsqueeze(-1)
        completed = torch.tensor(step.get("completed", step["skill"])).unsqueeze(-1)
        row["next"] = TensorDict({"completed": completed}, [episodes])
        watch(row)
    return watch.table().to_dict("records")


def test_a_part_is_held_against_the_first_state_of_its_own_episode():
    found = watched(
        {"skill": [0, 0], "at": [((0.0, 0.0), (1.0, 0.0)), ((0.2, 20.0), (1.0, 0.0))]},
        {"skill": [0, 0], "at": [((0.1, 0.0), (2.0, 0.0)), ((0.2, 20.0), (2.0, 0.0))], "completed": [1, 1]},
        {"skill": [1, 1], "at": [((0.3, 40.0), (2.0, 90.0)), ((0.2, 20.0), (1.5, 0.0))], "completed": [1, 2]},
    )
    assert [(seam["skill"], seam["step"], seam["succeeded"]) for seam in found] == [(1, 2, 0), (1, 2, 1)]
    assert [(seam["part_moved"], seam["part_turned"]) for seam in found] == [(0.3, 40.0), (0.0, 0.0)]
    assert [(seam["target_moved"], seam["target_turned"]) for seam in found] == [(1.0, 90.0), (0.5, 0.0)]


def test_nothing_is_noted_after_an_episode_is_done_nor_of_its_first_skill():
    lying = ((0.0, 0.0), (0.0, 0.0))
    assert watched({"skill": [0], "at": [lying], "completed": [1]}) == []
    ended = {"skill": [1], "at": [lying], "done": [True], "completed": [2]}
    assert watched({"skill": [0], "at": [lying]}, ended) == []


def test_nothing_is_noted_once_the_last_skill_has_succeeded():
    lying = ((0.0, 0.0), (0.0, 0.0))
    steps = [{"skill": [skill, 0], "at": [lying, lying]} for skill in (0, 1, 2)]
    found = watched(*steps)  # a chain of two skills, and an environment in which a third could follow
    assert [seam["skill"] for seam in found] == [1]


def test_what_moved_by_as_much_as_asked_in_either_way_counts_as_moved():
    rows = [(1, 0.01, 0.0, 0), (1, 0.0, 5.0, 1), (1, 0.02, 9.0, 0), (1, 0.009, 4.9, 1), (2, 0.0, 0.0, 1)]
    table = pd.DataFrame(rows, columns=["skill", "part_moved", "part_turned", "succeeded"])
    found = success_by_moved(table, from_metres=0.01, from_degrees=5.0)
    assert found["size"].to_dict() == {(1, "moved"): 3, (1, "not moved"): 1, (2, "not moved"): 1}
    assert found["mean"].tolist() == pytest.approx([1 / 3, 1.0, 1.0])


def measure(folder, *values: str) -> None:
    places = [f"{place}_dir={folder / place}" for place in ("results", "runs")]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/moved_parts", [*places, "progress_bar=false", *values])
    runpy.run_path(str(ROOT / "recipes/moved_parts.py"))["main"].__wrapped__(config)


def test_the_recipe_writes_a_row_for_each_hand_over(point_skills, tmp_path, capsys):
    """Skill 0 of the point always succeeds; its parts lie still, at 0 with a quaternion of no turn at all."""
    save_chain(point_skills, tmp_path / PLACE / "last")
    measure(tmp_path, "system=policy_sequencing", "evaluation.whole_episodes=32")
    table = pd.read_csv(tmp_path / "results/table_lack/policy_sequencing/seed0/moved_parts.csv")
    first = table[table.skill == 1]
    assert len(first) == 32 and set(table.skill) <= {1, 2, 3} and set(table.part_moved) == {0.0}
    assert int(first.succeeded.sum()) == int((table.skill == 2).sum())
    said = capsys.readouterr().out
    assert "moved_parts.csv" in said and re.search(r"^1 +not moved +32 +", said, re.MULTILINE)


def test_each_checkpoint_has_its_rows_and_new_ones_replace_them(point_skills, tmp_path):
    for checkpoint in ("last", "best"):
        save_chain(point_skills, tmp_path / PLACE / checkpoint)
    for checkpoint, episodes in (("last", 8), ("best", 16), ("last", 4)):
        number = f"evaluation.whole_episodes={episodes}"
        measure(tmp_path, "system=policy_sequencing", number, f"checkpoint={checkpoint}")
    table = pd.read_csv(tmp_path / "results/table_lack/policy_sequencing/seed0/moved_parts.csv")
    assert table[table.skill == 1].groupby("checkpoint").size().to_dict() == {"best": 16, "last": 4}


def test_a_chain_that_hands_nothing_over_is_told(point_skills, tmp_path):
    """Its first skill stands still."""
    point_skills[0].policy[0][1].module[0][-1].bias.data[0] = 0.0
    save_chain(point_skills, tmp_path / PLACE / "last")
    with pytest.raises(InvalidValueError, match="no skill was handed anything"):
        measure(tmp_path, "system=policy_sequencing", "evaluation.whole_episodes=4", "+env.max_steps=20")
