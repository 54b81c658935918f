"""From YAML to objects: the schema, loading and checking a config, and what is built from it.

The public names are imported when they are asked for: `config.load` loads no TorchRL, the others do.
"""

from typing import TYPE_CHECKING

from tstar_rl.deferred import deferred

if TYPE_CHECKING:
    from tstar_rl.config.build import (
        environment,
        load_demonstrations,
        load_skill,
        new_skill,
        new_spirl_agent,
        skill_training,
    )
    from tstar_rl.config.chain import chain_turns, load_skills
    from tstar_rl.config.check import ConfigError
    from tstar_rl.config.demonstrations import demonstrations_path
    from tstar_rl.config.load import check_config, recipe
    from tstar_rl.config.ranges import chain_length
    from tstar_rl.config.values import plain, settings

HOMES = {
    "ConfigError": "check",
    "chain_length": "ranges",
    "chain_turns": "chain",
    "check_config": "load",
    "demonstrations_path": "demonstrations",
    "environment": "build",
    "load_demonstrations": "build",
    "load_skill": "build",
    "load_skills": "chain",
    "new_skill": "build",
    "new_spirl_agent": "build",
    "plain": "values",
    "recipe": "load",
    "settings": "values",
    "skill_training": "build",
}
"""The module of each public name."""
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

__getattr__ = deferred(__name__, HOMES)
