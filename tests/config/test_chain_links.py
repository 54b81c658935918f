"""How many skills of a chain are asked for, and what a recipe of one must give."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from omegaconf import OmegaConf
from recorded import made_up

from tstar_rl.config import chain
from tstar_rl.config.chain import check_links
from tstar_rl.config.check import ConfigError
from tstar_rl.config.demonstrations import given_demonstrations
from tstar_rl.demonstrations.header import DemonstrationError


def test_a_trained_chain_has_all_its_skills_or_none_is_asked_for():
    for links in (None, 4):
        check_links(OmegaConf.create({"chain": {"links": links}}), 4)
    with pytest.raises(ConfigError, match="chain.links is 2, and this chain has 4 skills: leave it out"):
        check_links(OmegaConf.create({"chain": {"links": 2}}), 4)


@pytest.mark.parametrize("number", [1, 3])
def test_a_chain_needs_demonstrations_of_each_skill(number, monkeypatch):
    monkeypatch.setattr(chain, "load_skills", lambda *_, **__: [None, None])
    config = OmegaConf.create({"from_checkpoint": "last", "device": "cpu"})
    experts = [SimpleNamespace(to=lambda device: None)] * number
    with pytest.raises(ValueError, match=f"2 skills needs demonstrations of each, got {number}"):
        next(iter(chain.chain_turns(config, experts)))


def test_demonstrations_that_are_given_are_of_the_skill_that_learns_from_them():
    demonstrations = made_up()
    config = OmegaConf.create({"task": {"name": "table_lack"}, "device": "cpu"})
    assert len(given_demonstrations(config, 2, demonstrations)) == len(demonstrations)
    with pytest.raises(
        DemonstrationError, match="of table_lack, subtask 1, are wanted; got .* table_lack, subtask 2"
    ):
        given_demonstrations(config, 1, demonstrations)
    with pytest.raises(DemonstrationError, match="subtask 1, are wanted; got"):
        replace(demonstrations, subtask=1).and_also(demonstrations)
    own = SimpleNamespace(observations=demonstrations.observations, actions=demonstrations.actions)
    assert given_demonstrations(config, 1, own) is own


def test_a_chain_begins_with_a_checkpoint():
    with pytest.raises(ValueError, match="from_checkpoint must be one of last, best; got None"):
        next(iter(chain.chain_turns(OmegaConf.create({"from_checkpoint": None}))))
