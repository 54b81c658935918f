"""A recipe's command line: `--help`, and how it ends when its user made a mistake or stops it.

A mistake gives one or two lines on stderr and exit code 1, Ctrl-C one line and exit code 130, without a traceback.

What counts as one: a `UserError`, what Hydra says of the command line, and an `OSError` (a file that is not there, a
folder that cannot be written to, a full disk). Any other error is the program's, and shows its traceback. With
HYDRA_FULL_ERROR=1 every error does.
"""

import errno
import functools
import os
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import hydra
from hydra import compose, initialize_config_dir
from hydra._internal.utils import get_args_parser
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import CompactHydraException, HydraException, MissingConfigException, OverrideParseException
from omegaconf import DictConfig, OmegaConf, open_dict
from omegaconf.errors import OmegaConfBaseException
from tqdm import tqdm

from tstar_rl.checks import NothingToDo, UserError, did_you_mean

__all__ = ["command_line", "of_the_disk", "told_in_words"]

FULL_ERROR = "HYDRA_FULL_ERROR"
STOPPED = (
    "stopped; what was written stays, and the same command, without resume=false, goes on from the last checkpoint, "
    "if there is one"
)
BY_SIGINT = 130
"""Exit code of a process that Ctrl-C stopped, as shells have it."""
HINT = f"{FULL_ERROR}=1 shows where this was raised."
FULL_DISK = (errno.ENOSPC, errno.EDQUOT)
NOT_WRITABLE = (
    errno.EROFS, errno.EACCES, errno.EPERM, errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.ENAMETOOLONG,
)  # fmt: skip

Body = Callable[[DictConfig], None]
Check = Callable[[DictConfig], None]


def command_line(body: Body, configs: Path, name: str, check: Check) -> Callable[..., None]:
    """Makes a function of a config into one that reads the command line; with a config as its argument it runs that.

    Args:
        body: runs the recipe.
        configs: the folder of the configs.
        name: of the recipe's file in its folder `recipe`.
        check: raises for a config with a key that is not known.
    """

    def job(config: DictConfig) -> None:
        os.environ.pop(
            FULL_ERROR, None
        )  # it was for Hydra; the recipes that this one starts tell in words too
        try:
            with told_in_words():
                body(config)
        except (HydraException, OmegaConfBaseException) as error:  # of the config of a step that it starts
            raise SystemExit(f"{_in_words(error, configs, name, check)}\n{HINT}") from None

    def start(function: Body) -> None:
        hydra.main(version_base="1.3", config_path=str(configs), config_name=f"recipe/{name}")(function)()

    @functools.wraps(body)
    def main(config: DictConfig | None = None) -> None:
        if config is not None:
            return body(config)
        if not configs.is_dir():
            raise SystemExit(f"a recipe needs a clone, installed with pip install -e: there is no {configs}")
        if os.environ.get(FULL_ERROR) == "1":
            return start(body)
        _check_dashes()
        _check_groups(configs)
        helps = bool({"--help", "-h"} & set(sys.argv[1:]))
        os.environ[FULL_ERROR] = "1"  # Hydra then raises what it would print in its own words
        try:
            if helps:
                print(sys.modules[body.__module__].__doc__)
            try:
                start(job)
            finally:
                if helps:  # which ends in an exit, where nothing catches that a reader is gone
                    sys.stdout.flush()
        except BrokenPipeError:
            if not helps:
                raise
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # `| head` has read enough
        except KeyboardInterrupt:
            print(f"\n{STOPPED}", file=sys.stderr)
            raise SystemExit(BY_SIGINT) from None
        except (HydraException, OmegaConfBaseException) as error:
            raise SystemExit(f"{_in_words(error, configs, name, check)}\n{HINT}") from None
        finally:
            os.environ.pop(FULL_ERROR, None)

    return main


@contextmanager
def told_in_words() -> Iterator[None]:
    """Ends the process with the message of a user's mistake, of a disk that takes no more or of work that is done.

    Raises:
        SystemExit: with that message; Python writes it to stderr and exits with code 1. With 0 where nothing is to do.
    """
    try:
        yield
    except NothingToDo as told:
        _clear_bars()
        print(told)
        raise SystemExit(0) from None
    except UserError as error:
        _clear_bars()
        raise SystemExit(f"{error}\n{HINT}") from None
    except OSError as error:
        if error.errno is None and not isinstance(error, FileNotFoundError):
            raise
        _clear_bars()
        raise SystemExit(f"{of_the_disk(error)}\n{HINT}") from None


def _clear_bars() -> None:
    """Takes progress bars off the screen, on whose line a message would begin."""
    for bar in list(getattr(tqdm, "_instances", ())):
        bar.leave = False
        bar.close()


def of_the_disk(error: OSError) -> str:
    """What a message says of a file or folder that cannot be read or written."""
    if error.errno in FULL_DISK:
        said = "What was written before stays as it was: make room, then give the same command again"
        return f"no space left on the disk for {error.filename or 'a file'}. {said}"
    if error.errno in NOT_WRITABLE:
        places = "results_dir=... runs_dir=... demonstrations_dir=... give other folders"
        return f"{error.filename or 'a file'} cannot be read or written ({error.strerror}): {places}"
    return str(error)


def _in_words(error: Exception, configs: Path, name: str, check: Check) -> str:
    """What the command line should have been."""
    text = " ".join(str(error).split())
    if isinstance(error, MissingConfigException) and error.missing_cfg_file:
        return _missing_file(Path(error.missing_cfg_file), configs, name)
    if isinstance(error, OverrideParseException):
        return (
            f"cannot read {error.override!r}: write key=value, lists as [1,2], null for nothing, and a value with "
            """other characters in quotes: "key='a=b,c'\""""
        )
    unknown = re.match(r"Could not override '([^']+)'", text)
    if unknown:
        return _unknown_key(unknown[1], configs, name, check)
    cause = error.__cause__ if isinstance(error, CompactHydraException) else None
    return f"{text} ({' '.join(str(cause).split())})" if cause and str(cause) not in text else text


def _check_dashes() -> None:
    """Ends the process where a value is given as other programs have it: --seed 0, --seed=0; also for Hydra's sweeps.

    A sweep runs its jobs in one process, which ends with the first that has nothing to do or fails.
    """
    if sweep := {"-m", "--multirun"} & set(sys.argv[1:]):
        raise SystemExit(
            f"{sweep.pop()} is not for recipes, each of which runs once: loop in the shell\n{HINT}"
        )
    unknown = [text for text in get_args_parser().parse_known_args()[1] if text.startswith("--")]
    if not unknown:
        return
    name, given, value = unknown[0].removeprefix("--").partition("=")
    if not given:
        following = "".join(sys.argv[sys.argv.index(unknown[0]) + 1 :][:1])
        value = "..." if not following or "=" in following or following.startswith("-") else following
    told = f"{unknown[0]} is no option: values are given without dashes, {name}={value}"
    raise SystemExit(f"{told}\n{HINT}")


def _check_groups(configs: Path) -> None:
    """Ends the process where the command line gives a group of configs no file of it, which Hydra has no words for."""
    for text in sys.argv[1:]:
        group, given, option = text.partition("=")
        if given and option.strip() in ("", "null") and group and (configs / group).is_dir():
            said = _must_be(group, _options(configs, group))
            raise SystemExit(f"{said}, got {option.strip() or 'nothing'}\n{HINT}")


def _options(configs: Path, group: str) -> list[str]:
    return sorted(path.stem for path in (configs / group).glob("*.yaml"))


def _must_be(group: str, options: list[str]) -> str:
    return f"{group} must be one of {', '.join(options)} (files of configs/{group})"


def _missing_file(missing: Path, configs: Path, name: str) -> str:
    """For an option that a group has no file for, or a recipe (`name`) without one."""
    group, option = missing.parent.as_posix(), missing.name.removesuffix(".yaml")
    if missing == Path("recipe", name):
        return f"the recipe {name} needs a file of its values, {configs / missing}.yaml, which is not there"
    valid = _options(configs, group)
    if not valid:
        groups = sorted(path.name for path in configs.iterdir() if path.is_dir())
        return f"there is no {missing} in {configs}; its folders are {', '.join(groups)}"
    chosen = (configs / "recipe" / f"{name}.yaml").read_text()
    given = any(text.startswith(f"{group}=") for text in sys.argv[1:])
    if f"/{group}: ${{scale}}" in chosen and not given:
        has = f"{group}={option} has no file in configs/{group}, where the recipe {name} looks for the scale's name"
        return f"{has}; scales with one are {', '.join(valid)}; or choose one beside your scale: {group}={valid[0]}"
    return f"{group}={option}: {_must_be(group, valid)}{did_you_mean(option, valid)}"


def _unknown_key(key: str, configs: Path, name: str, check: Check) -> str:
    """For a key that the recipe's config does not have: what `check` says of it, or how to add it."""
    groups = [path.name for path in configs.iterdir() if path.is_dir()]
    if key in groups:
        return f"{key}=... chooses a file of configs/{key}, and the recipe {name} has no values of these"
    if hint := did_you_mean(key, groups, cutoff=0.75):
        return f"the config of {name} has no {key}{hint}"
    try:
        begun = GlobalHydra.instance().is_initialized()  # by a recipe that composes the config of a step
        with nullcontext() if begun else initialize_config_dir(str(configs), version_base="1.3"):
            config = compose(f"recipe/{name}")
        section, _, last = key.rpartition(".")
        there = OmegaConf.select(config, section) if section else config
        near = did_you_mean(last, [*there]) if isinstance(there, DictConfig) else ""
        with open_dict(config):
            OmegaConf.update(config, key, _given(key), force_add=True)
        check(config)
    except UserError as error:
        return f"{error} (of the recipe {name})"
    except (OmegaConfBaseException, TypeError) as error:  # the key goes through something that is no section
        return f"the config of {name} has no {key}: {' '.join(str(error).split())}"
    return f"{key} is valid, but not set in the configs of {name}: write +{key}=...{near}"


def _given(key: str) -> Any:
    """The value of a key on the command line."""
    texts = [text.split("=", 1)[1] for text in sys.argv[1:] if text.startswith(f"{key}=")]
    return OverridesParser.create().parse_override(f"{key}={texts[-1]}").value() if texts else None
