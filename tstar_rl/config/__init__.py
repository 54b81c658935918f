"""From YAML to objects: the schema, loading and checking a config, and what is built from it."""

from tstar_rl.config.build import (
    demonstrations_path,
    environment,
    load_demonstrations,
    load_skill,
    new_skill,
    new_spirl_agent,
    skill_training,
)
from tstar_rl.config.chain import chain_length, chain_turns, load_skills
from tstar_rl.config.check import ConfigError
from tstar_rl.config.load import check_config, plain, recipe, settings

__all__ = [
    "ConfigError",
    "chain_length",
    "chain_turns",
    "check_config",
    "demonstrations_path",
    "environment",
    "load_demonstrations",
    "load_skill",
    "load_skills",
    "new_skill",
    "new_spirl_agent",
    "plain",
    "recipe",
    "settings",
    "skill_training",
]
