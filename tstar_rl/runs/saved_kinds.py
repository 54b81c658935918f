"""What is saved in a folder, in the words of a message to whoever took it for something else."""

from collections.abc import Mapping
from typing import Any

__all__ = ["AN_AGENT", "A_SHIPPED_CHAIN", "ONE_SKILL", "kind_of"]

AN_AGENT = "an agent of SPiRL: SpirlAgent.load reads it"
A_SHIPPED_CHAIN = "a shipped chain: load_pretrained(task, variant, folder=...) reads it"
ONE_SKILL = "one skill: Skill.load reads it"


def kind_of(record: Mapping[str, Any]) -> str:
    """What a record is of, and what reads it.

    Args:
        record: what was saved with it, of a skill, an agent of SPiRL, a chain that `ship.py` wrote, or a run that goes
            on from there.
    """
    built = record.get("built")
    if built is None:
        return "what a run goes on from: what it has trained lies beside its checkpoints, in last and best"
    if isinstance(built, list):
        return A_SHIPPED_CHAIN
    if "latent_model" in built:
        return AN_AGENT
    return ONE_SKILL
