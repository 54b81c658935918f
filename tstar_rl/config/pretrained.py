"""A shipped chain in a recipe: the config takes over where it was trained, and how it was evaluated."""

import re
from collections.abc import Iterable, Mapping
from typing import Any

from omegaconf import DictConfig, open_dict

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.values import plain, task_section
from tstar_rl.shipped.catalogue import CHAINS, find_pretrained
from tstar_rl.shipped.chain import ShippedChain, load_shipped

__all__ = ["chain_env", "take_pretrained"]

ITS_OWN = ("task", "scale", "env", "system", "subtask", "path", "checkpoints", "chain.links")
"""Values that a shipped chain brings with it; single settings of the task (env.noise=...) may be given."""


def take_pretrained(config: DictConfig, given: Iterable[str]) -> ShippedChain:
    """Loads the chain config.pretrained, "<task>" or "<task>/<variant>", and gives the config what belongs to it.

    That is the task, its settings (`chain_env`), and, where the command line does not give them, the seed and the
    number of episodes that its figures are of. The system becomes pretrained/<variant>: a results folder of its own.

    Args:
        config: changed in place.
        given: the values of the command line.

    Raises:
        InvalidValueError: for an unknown chain, or a value on the command line that the chain brings.
    """
    given = list(given)
    names = {value.split("=")[0].lstrip("+~") for value in given}
    if twice := sorted(names & set(ITS_OWN)):
        raise InvalidValueError(
            f"pretrained={config.pretrained} brings its own {', '.join(twice)}: leave {'=..., '.join(twice)}=... out"
        )
    place = find_pretrained(config.pretrained, folder=config.pretrained_dir or CHAINS)
    task, variant = place.parent.name, place.name
    chain = load_shipped(place, task=task)
    with open_dict(config):
        config.task = task_section(task)
        config.env = chain_env(chain, config, given)
        config.system, config.subtask = f"pretrained/{variant}", None
        if "seed" not in names:
            config.seed = chain.record["seed"]
        if "evaluation.whole_episodes" not in names:
            config.evaluation.whole_episodes = max(
                int(row["episodes"]) for row in chain.record["figures"].values()
            )
    return chain


def chain_env(chain: ShippedChain, config: DictConfig, given: Iterable[str]) -> dict[str, Any]:
    """The settings of the task that a chain was trained with, but for those that the command line gives one by one."""
    asked = {found[1] for value in given if (found := re.match(r"\+*env\.(\w+)=", value))}
    values: Mapping[str, Any] = plain(config)["env"]
    return {**chain.env_settings, **{name: values[name] for name in asked if name in values}}
