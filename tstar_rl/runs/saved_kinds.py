"""What is saved in a folder, in the words of a message to whoever took it for something else."""

from collections.abc import Mapping
from typing import Any

__all__ = ["ONE_SKILL", "kind_of"]

ONE_SKILL = "one skill: Skill.load reads it"


def kind_of(record: Mapping[str, Any]) -> str:
    """What a record is of, and what reads it.

    Args:
        record: what was saved with it, of a skill, an agent of SPiRL or a chain that `ship.py` wrote.
    """
    if isinstance(record["built"], list):
        return "a shipped chain: load_pretrained(task, variant, folder=...) reads it"
    if "latent_model" in record["built"]:
        return "an agent of SPiRL: SpirlAgent.load reads it"
    return ONE_SKILL
