"""How many skills of a chain are asked for."""

import pytest
from omegaconf import OmegaConf

from tstar_rl.config.chain import check_links
from tstar_rl.config.check import ConfigError


def test_a_trained_chain_has_all_its_skills_or_none_is_asked_for():
    for links in (None, 4):
        check_links(OmegaConf.create({"chain": {"links": links}}), 4)
    with pytest.raises(ConfigError, match="chain.links is 2, and this chain has 4 skills: leave it out"):
        check_links(OmegaConf.create({"chain": {"links": 2}}), 4)
