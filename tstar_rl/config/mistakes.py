"""What Hydra refuses of a command line, or of values in a program, in the words of a recipe's user."""

import re
import sys
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import (
    CompactHydraException,
    HydraException,
    MissingConfigException,
    OverrideParseException,
)
from omegaconf import DictConfig, OmegaConf, open_dict
from omegaconf.errors import OmegaConfBaseException

from tstar_rl.checks import UserError, did_you_mean

__all__ = ["Check", "choices", "in_words", "refused_choice"]

Check = Callable[[DictConfig], None]


def in_words(
    error: Exception, configs: Path, name: str, check: Check | None, given: Sequence[str] | None = None
) -> str:
    """What the command line should have been.

    Args:
        error: Hydra's.
        configs: the folder of the configs.
        name: of the recipe.
        check: raises for a config with a key that is not known. None: that is not known here, as of another commit.
        given: the values; None: those of the command line.
    """
    given = sys.argv[1:] if given is None else given
    text = " ".join(str(error).split())
    if isinstance(error, MissingConfigException) and error.missing_cfg_file:
        return _missing_file(Path(error.missing_cfg_file), configs, name, given)
    if isinstance(error, OverrideParseException):
        return (
            f"cannot read {error.override!r}: write key=value, lists as [1,2], null for nothing, and a value with "
            """other characters in quotes: "key='a=b,c'\""""
        )
    if several := re.match(r"Ambiguous value for argument '([^=]+)=(.*?)' 1\.", text):
        return (
            f"{several[1]} must be one value, or a list, as [{several[2]}], where it is one; got {several[2]}"
        )
    unknown = re.match(r"Could not override '([^']+)'", text)
    if unknown:
        return _unknown_key(unknown[1], configs, name, check, given)
    cause = error.__cause__ if isinstance(error, CompactHydraException) else None
    return f"{text} ({' '.join(str(cause).split())})" if cause and str(cause) not in text else text


def options(configs: Path, group: str) -> list[str]:
    """The files of a group of configs, by name."""
    return sorted(path.stem for path in (configs / group).glob("*.yaml"))


def refused_choice(given: Sequence[str], configs: Path) -> str | None:
    """What is wrong with a value that gives a group of configs no name of a file; None: nothing.

    Hydra has no words for nothing and for a number, and of a list of files it would take what the last says of each.
    Ablations alone may be several.
    """
    for text in given:
        group, equals, option = text.partition("=")
        if not equals or not group or not (configs / group).is_dir():
            continue
        try:
            chosen = OverridesParser.create().parse_override(text).value()
        except HydraException:  # it has words for what cannot be read
            continue
        if not (isinstance(chosen, str) and chosen) and not (
            group == "ablation" and isinstance(chosen, list)
        ):
            return f"{must_be(group, options(configs, group))}, got {option.strip() or 'nothing'}"
    return None


def choices(configs: Path, name: str) -> str:
    """What the help of a recipe says of the groups of configs that it chooses files of, with these files.

    Nothing of a recipe whose own file lies elsewhere.
    """
    file = configs / "recipe" / f"{name}.yaml"
    groups = re.findall(r"^ +- /(\w+):", file.read_text(), re.MULTILINE) if file.is_file() else []
    lines = [f"  {group}=<{', '.join(options(configs, group))}>" for group in groups]
    said = ["Files of configs/ to choose, one of each:", *lines, ""] if lines else []
    return "\n".join([*said, "Its values, to be changed as <name>=<value> (docs/usage.md):"])


def must_be(group: str, valid: list[str]) -> str:
    """What a group's value must be."""
    return f"{group} must be one of {', '.join(valid)} (files of configs/{group})"


def _missing_file(missing: Path, configs: Path, name: str, given: Sequence[str]) -> str:
    """For an option that a group has no file for, or a recipe (`name`) without one."""
    group, option = missing.parent.as_posix(), missing.name.removesuffix(".yaml")
    if missing == Path("recipe", name):
        return (
            f"the recipe {name} needs a file of its values, {configs / missing}.yaml, which is not there; one that "
            f"lies elsewhere, as <folder>/{missing}.yaml, is found with --config-dir <folder>"
        )
    valid = options(configs, group)
    if not valid:
        groups = sorted(path.name for path in configs.iterdir() if path.is_dir())
        return f"there is no {missing} in {configs}; its folders are {', '.join(groups)}"
    file = configs / "recipe" / f"{name}.yaml"  # not there: of a recipe of a user's own, from --config-dir
    chosen = file.read_text() if file.is_file() else ""
    asked = any(text.startswith(f"{group}=") for text in given)
    if f"/{group}: ${{scale}}" in chosen and not asked:
        has = f"{group}={option} has no file in configs/{group}, where the recipe {name} looks for the scale's name"
        return f"{has}; scales with one are {', '.join(valid)}; or choose one beside your scale: {group}={valid[0]}"
    return f"{group}={option}: {must_be(group, valid)}{did_you_mean(option, valid)}"


def _unknown_key(key: str, configs: Path, name: str, check: Check | None, given: Sequence[str]) -> str:
    """For a key that the recipe's config does not have: what `check` says of it, or how to add it."""
    groups = [path.name for path in configs.iterdir() if path.is_dir()]
    if key in groups:
        return f"{key}=... chooses a file of configs/{key}, and the recipe {name} has no values of these"
    if hint := did_you_mean(key, groups, cutoff=0.75):
        return f"the config of {name} has no {key}{hint}"
    try:
        begun = GlobalHydra.instance().is_initialized()  # by a recipe that composes the config of a step
        with nullcontext() if begun else initialize_config_dir(str(configs), version_base="1.3"):
            config = _beside(key, name, given)
        section, _, last = key.rpartition(".")
        there = OmegaConf.select(config, section) if section else config
        near = did_you_mean(last, [*there]) if isinstance(there, DictConfig) else ""
        if check is None:
            said = f"the configs of {name} at that commit have no {key}"
            return f"{said} (a field that its code declares all the same takes a +: +{key}=...){near}"
        with open_dict(config):
            OmegaConf.update(config, key, _given(key, given), force_add=True)
        check(config)
    except UserError as error:
        return f"{error} (of the recipe {name})"
    except MissingConfigException:  # a user's own, whose values lie elsewhere
        said = f"the file of {name}'s values has no {key}; a field that is declared all the same takes a +"
        return f"{said}: +{key}=..."
    except (OmegaConfBaseException, TypeError) as error:  # the key goes through something that is no section
        return f"the config of {name} has no {key}: {' '.join(str(error).split())}"
    return f"{key} is valid, but not set in the configs of {name}: write +{key}=...{near}"


def _beside(key: str, name: str, given: Sequence[str]) -> DictConfig:
    """The recipe's config with the other values that are given, or without where these are mistakes too."""
    try:
        return compose(f"recipe/{name}", [text for text in given if not text.startswith(f"{key}=")])
    except HydraException:
        return compose(f"recipe/{name}")


def _given(key: str, given: Sequence[str]) -> Any:
    """The value of a key among those given."""
    texts = [text.split("=", 1)[1] for text in given if text.startswith(f"{key}=")]
    return OverridesParser.create().parse_override(f"{key}={texts[-1]}").value() if texts else None
