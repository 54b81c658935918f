"""Rollouts of a collection that was saved and loaded."""

import pytest
import torch
from point_chain import PointChain
from torchrl.data import Composite, Unbounded

from tstar_rl import FurnitureEnv
from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import InvalidValueError
from tstar_rl.models.network_settings import NetworkSettings
from tstar_rl.rollouts.collection import Collection, with_starts


def test_rollouts_go_on_bit_for_bit_from_their_state():
    torch.manual_seed(0)
    skill = Skill("table_lack", 0, NetworkSettings(hidden=(16,), std="fixed"))

    def collection(seed: int) -> Collection:
        env = FurnitureEnv("table_lack", 3, 0, nthread=1, seed=seed, max_steps=6)
        return Collection(with_starts(env), skill.policy, 8)

    first, second = collection(0), collection(1)
    first.rollout()
    first.settle()
    second.load_state_dict(first.state_dict())
    torch.manual_seed(1)
    expected = first.rollout()
    torch.manual_seed(1)
    resumed = second.rollout()
    for key in ("observation", "action", ("next", "reward_env"), ("next", "done"), "start_observation"):
        assert torch.equal(expected[key], resumed[key]), key


def test_an_environment_that_says_nothing_of_its_state_is_not_saved():
    env = PointChain("table_lack", 2, seed=0)
    env.state_dict = dict
    collection = Collection(with_starts(env), lambda step: step.set("action", torch.zeros(2, 9)), 1)
    with pytest.raises(InvalidValueError, match=r"PointChain cannot be saved: its state_dict\(\) is empty"):
        collection.state_dict()


def test_an_environment_that_lacks_what_skills_read_is_told_what():
    env = PointChain("table_lack", 4, seed=0)
    del env.observation_spec["phase"]
    env.reward_spec = Composite(reward=Unbounded((4, 1)), shape=[4])
    with pytest.raises(
        InvalidValueError, match="PointChain has no phase, reward_env; an environment of skills gives"
    ):
        with_starts(env)
