"""From a trained chain to the policy that runs it: with recovery, if that is what `recover.py` saved with it."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from omegaconf import DictConfig

from tstar_rl.chaining.chain import ChainPolicy
from tstar_rl.chaining.recovery import RecoveringChain, RecoverySettings
from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import InvalidValueError
from tstar_rl.config.values import settings
from tstar_rl.env.homing import way_home
from tstar_rl.env.task_tables import DEFAULT_SETTINGS
from tstar_rl.runs.checkpoint import read_record

__all__ = ["chain_policy", "refuse_recovery"]


def chain_policy(config: DictConfig, skills: Sequence[Skill], folders: Sequence[Path]) -> ChainPolicy:
    """The policy that runs a chain in the world of a config.

    Args:
        config: its env settings.
        skills: of the chain, in order.
        folders: where they were saved.
    """
    recovery = read_record(folders[0]).get("recovery")
    if recovery is None:
        return ChainPolicy(skills)
    scale = config.env.get("velocity_scale", DEFAULT_SETTINGS["velocity_scale"])
    return RecoveringChain(
        skills,
        partial(way_home, velocity_scale=scale),
        settings(RecoverySettings, recovery["settings"]),
        recovery["shares"],
    )


def refuse_recovery(folder: Path) -> None:
    """Raises InvalidValueError if the chain whose first skill is saved in `folder` has recovery."""
    if read_record(folder).get("recovery") is not None:
        raise InvalidValueError(
            f"{folder.parent} is a chain with recovery, which evaluate.py and ways_home.py alone run; its skills are "
            "those of the chain that it was made from"
        )
