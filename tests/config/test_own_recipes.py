"""A recipe of a user's own: its keys are its own, and so is what it pays."""

from collections.abc import Iterator
from typing import Any

import pytest
import torch
from omegaconf import DictConfig, open_dict
from tensordict import TensorDict

import tstar_rl as rl
from tstar_rl.config import load
from tstar_rl.config.check import ConfigError
from tstar_rl.config.load import check_config


@pytest.fixture
def mine(monkeypatch) -> Iterator[Any]:
    """A config of `like` as that of the recipe "mine" with keys of its own."""

    def make(like: str, *values: str, **own: tuple[Any, Any]) -> DictConfig:
        config = rl.compose(like, *values)
        kinds = {key: kind for key, (kind, _) in own.items()}
        monkeypatch.setitem(load.OWN_KEYS, "mine", load.own_keys(like) | kinds)
        with open_dict(config):
            config.system = "mine"
            config.update({key: value for key, (_, value) in own.items()})
        return config

    return make


@pytest.mark.parametrize(
    "own",
    [
        {"mode": (str, "soft")},
        {"alpha": (float, -1.0)},
        {"decay": (float, 1.5)},
        {"noise": (tuple[float, ...], [0.1, 0.2])},
        {"states": (str, "all")},
        {"seeds": (int, 3)},
        {"proximity": (dict[str, float], {"radius": 0.5})},
    ],
)
def test_a_key_that_another_recipe_has_too_may_be_anything(mine, own):
    check_config(mine("gail_ppo", "subtask=0", **own), "mine")


def test_keys_of_all_recipes_and_types_of_its_own_are_checked(mine):
    config = mine("gail_ppo", "subtask=0", alpha=(float, 0.5))
    config.alpha = "much"
    with pytest.raises(ConfigError, match="alpha must be a number, got 'much'"):
        check_config(config, "mine")
    config.alpha, config.training.num_envs = 0.5, 0
    with pytest.raises(ConfigError, match="training.num_envs must be a whole number from 1, got 0"):
        check_config(config, "mine")


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("subtask", 2, "subtask must be null, got 2"),
        ("from_checkpoint", "lst", "from_checkpoint must be one of last, best"),
    ],
)
def test_what_no_chain_reads_is_refused_in_a_recipe_of_its_own_too(mine, key, value, message):
    config = mine("policy_sequencing")
    config[key] = value
    with pytest.raises(ConfigError, match=message):
        check_config(config, "mine")


def test_a_term_of_its_own_may_be_all_that_is_paid(mine):
    config = mine("gail_ppo", "subtask=0")
    config.reward.weights = {"env": 0.0, "gail": 0.0, "tsr": 0.0, "up": 1.0}
    check_config(config, "mine")
    config.reward.weights = {"env": 0.0, "gail": 0.0, "tsr": 1.0, "proximity": 1.0}
    with pytest.raises(
        ConfigError, match="pay env, gail or a term of your own: the last skill has no next one"
    ):
        check_config(config, "mine")


class Nowhere:
    """Starts of nobody."""

    def sample(self, n: int, generator: torch.Generator) -> TensorDict:
        return TensorDict(batch_size=[0])


def test_starts_that_would_never_be_drawn_from_are_refused():
    config = rl.compose("gail_ppo", "subtask=1")
    with pytest.raises(
        rl.InvalidValueError, match=r"training.demonstration_starts of the episodes .*; got 0.0$"
    ):
        rl.environment(config, 1, 2, 0, starts=Nowhere())
    config.training.demonstration_starts = 0.5
    with pytest.raises(rl.InvalidValueError, match="and a termination set as well"):
        rl.environment(config, 1, 2, 0, before=rl.TerminationSet(4), starts=Nowhere())


def test_a_recipe_of_a_chain_says_which_checkpoint_it_begins_with():
    with pytest.raises(rl.InvalidValueError, match=r"@rl.recipe\(..., from_checkpoint=str\)"):
        next(iter(rl.chain_turns(rl.compose("gail_ppo", "subtask=0"))))
