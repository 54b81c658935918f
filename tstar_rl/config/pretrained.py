"""A shipped chain in a recipe: the config takes over where it was trained, and how it was evaluated."""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, open_dict

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.overrides import key_of, section_of
from tstar_rl.config.values import plain, task_section
from tstar_rl.env.task_tables import furniture_digest
from tstar_rl.runs.mismatch import FURNITURE, CheckpointMismatchError
from tstar_rl.runs.run_config import read_config
from tstar_rl.shipped.catalogue import CHAINS, find_pretrained
from tstar_rl.shipped.chain import ShippedChain, load_shipped

__all__ = ["chain_env", "check_same_chain", "take_pretrained"]

ITS_OWN = ("task", "scale", "env", "system", "subtask", "path", "checkpoints", "chain.links")
"""Values that a shipped chain brings with it; single settings of the task (env.noise=...) may be given."""


def take_pretrained(config: DictConfig, given: Iterable[str]) -> ShippedChain:
    """Loads the chain config.pretrained, "<task>" or "<task>/<variant>", and gives the config what belongs to it.

    That is the task, its settings (`chain_env`), and, where the command line does not give them, the seed and the
    number of episodes that its figures are of. The system becomes pretrained/<variant>, or shipped/<variant> where the
    chain is none of the package's: a results folder of its own. pretrained_sha256 tells the chain from others.

    Args:
        config: changed in place.
        given: the values of the command line.

    Raises:
        InvalidValueError: for an unknown chain, or a value on the command line that the chain brings.
    """
    given = list(given)
    names = {key_of(value) for value in given}
    if twice := sorted(names & set(ITS_OWN)):
        raise InvalidValueError(
            f"pretrained={config.pretrained} brings its own {', '.join(twice)}: leave {'=..., '.join(twice)}=... out"
        )
    folder = Path(config.pretrained_dir or CHAINS)
    place = find_pretrained(config.pretrained, folder=folder)
    task, variant = place.parent.name, place.name
    whose = "pretrained" if folder.resolve() == CHAINS.resolve() else "shipped"
    chain = load_shipped(place, task=task)
    with open_dict(config):
        config.task, config[FURNITURE] = task_section(task), furniture_digest(task)
        config.env = chain_env(chain, config, given)
        config.system, config.subtask = f"{whose}/{variant}", None
        config.pretrained_sha256 = chain.sha256
        if "seed" not in names:
            config.seed = chain.record["seed"]
        if not any("whole_episodes" in value for value in given if section_of(value) == "evaluation"):
            config.evaluation.whole_episodes = max(
                int(row["episodes"]) for row in chain.record["figures"].values()
            )
    return chain


def check_same_chain(results: Path, config: DictConfig) -> None:
    """Refuses to write into a folder of results that has those of another chain of the same name.

    Args:
        results: its config.yaml says which chain was evaluated; an older one does not.
        config: as `take_pretrained` leaves it.

    Raises:
        CheckpointMismatchError: it names the folder.
    """
    saved = read_config(results)
    if saved.get("pretrained_sha256") not in (None, config.pretrained_sha256):
        folder = saved.get("pretrained_dir") or CHAINS
        raise CheckpointMismatchError(
            f"{results} has the results of another chain of this name, which was in {folder}: delete that folder of "
            "results, or give another results_dir=..."
        )


def chain_env(chain: ShippedChain, config: DictConfig, given: Iterable[str]) -> dict[str, Any]:
    """The settings of the task that a chain was trained with, but for those that the command line gives one by one."""
    asked = {found[1] for value in given if (found := re.match(r"\+*env\.(\w+)=", value))}
    values: Mapping[str, Any] = plain(config)["env"]
    return {**chain.env_settings, **{name: values[name] for name in asked if name in values}}
