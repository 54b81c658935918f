"""What is logged of a rollout: means over its episodes, those that begin within a demonstration apart."""

import math

import pandas as pd
import pytest
import torch
from recipe_runs import SMALL, metrics, places
from tensordict import TensorDict

from tstar_rl.rollouts.collection import rollout_metrics


def rollout() -> TensorDict:
    """Two simulations, four steps; the first has three episodes, the second one that has not ended."""
    done = [[1, 0, 1, 1], [0, 0, 0, 0]]
    success = [[1, 0, 0, 1], [0, 0, 0, 0]]
    steps = [[5, 1, 2, 1], [1, 2, 3, 4]]
    phase = [[7, 0, 4, 7], [1, 1, 2, 2]]
    values = {"done": done, "success": success, "completed": success, "step_count": steps, "phase": phase}
    following = {name: torch.tensor(rows).unsqueeze(-1) for name, rows in values.items()}
    following |= {name: following[name].bool() for name in ("done", "success")}
    following["reward"] = torch.ones(2, 4, 1)
    return TensorDict({"next": TensorDict(following, [2, 4])}, [2, 4])


def test_the_means_are_over_episodes_that_ended():
    log = rollout_metrics(rollout())
    expected = {"episodes": 3, "success_rate": 2 / 3, "completed": 2 / 3, "episode_length": 8 / 3, "phase": 3}
    assert log == pytest.approx(expected | {"reward": 1})


def test_episodes_that_begin_in_a_demonstration_are_counted_apart():
    apart = torch.tensor([[0, 1, 1, 1], [0, 0, 0, 0]], dtype=torch.bool).unsqueeze(-1)
    log = rollout_metrics(rollout(), apart)
    expected = {"episodes": 1, "success_rate": 1, "completed": 1, "episode_length": 5, "phase": 13 / 5}
    assert log == pytest.approx(expected | {"episodes_apart": 2, "success_rate_apart": 0.5, "reward": 1})


def test_without_an_episode_of_its_own_a_policy_has_no_success_rate():
    log = rollout_metrics(rollout(), torch.ones(2, 4, 1, dtype=torch.bool))
    assert log["episodes"] == 0 and log["episodes_apart"] == 3
    assert all(math.isnan(log[name]) for name in ("success_rate", "completed", "episode_length", "phase"))


def test_a_skill_in_training_is_judged_by_its_own_starts(call, tmp_path):
    demonstrations = f"demonstrations_dir={tmp_path / 'demonstrations'}"
    call("make_demonstrations", *SMALL, "subtask=0", "kinds=[noisy]", demonstrations)
    starts = ["training.demonstration_starts=0.9", "training.demonstration_steps=2", "training.max_steps=12"]
    call("gail_ppo", *SMALL, "subtask=0", demonstrations, *starts, *places(tmp_path, "a"))
    table = pd.read_csv(metrics(tmp_path, "a"))
    own, others = table.episodes.sum(), table.episodes_apart.sum()
    assert 0 < own < others / 4
    assert others > 150, "those from demonstrations have two steps; of twelve steps there would be 85 at most"
    assert table.episode_length.max() == 12
