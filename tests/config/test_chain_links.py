"""How many skills of a chain are asked for, and what a recipe of one must give."""

from types import SimpleNamespace

import pytest
from omegaconf import OmegaConf

from tstar_rl.config import chain
from tstar_rl.config.chain import check_links
from tstar_rl.config.check import ConfigError


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


def test_a_chain_begins_with_a_checkpoint():
    with pytest.raises(ValueError, match="from_checkpoint must be one of last, best; got None"):
        next(iter(chain.chain_turns(OmegaConf.create({"from_checkpoint": None}))))
