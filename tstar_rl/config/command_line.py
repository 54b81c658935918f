"""A recipe's command line: `--help`, and how it ends when its user made a mistake or stops it.

A mistake gives one or two lines on stderr and exit code 1, Ctrl-C one line and exit code 130, without a traceback.

What counts as one: a `UserError`, what Hydra says of the command line, and an `OSError` (a file that is not there, a
folder that cannot be written to, a full disk). Any other error is the program's, and shows its traceback. With
HYDRA_FULL_ERROR=1 every error does.
"""

import errno
import functools
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import hydra
from hydra._internal.utils import get_args_parser
from hydra.errors import HydraException
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException
from tqdm import tqdm

from tstar_rl.checks import InvalidValueError, NothingToDo, UserError
from tstar_rl.config.mistakes import Check, choices, in_words, refused_choice

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


def command_line(body: Body, configs: Path, name: str, check: Check) -> Callable[..., None]:
    """Makes a function of a config into one that reads the command line; with a config as its argument it runs that.

    A recipe that asks what was given on its command line (one that starts others, evaluate, export, watch) raises an
    InvalidValueError then.

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
            raise SystemExit(f"{in_words(error, configs, name, check)}\n{HINT}") from None

    def start(function: Body) -> None:
        hydra.main(version_base="1.3", config_path=str(configs), config_name=f"recipe/{name}")(function)()

    @functools.wraps(body)
    def main(config: DictConfig | None = None) -> None:
        if config is not None:
            return _run(body, config, name)
        if not configs.is_dir():
            raise SystemExit(f"a recipe needs a clone, installed with pip install -e: there is no {configs}")
        if os.environ.get(FULL_ERROR) == "1":
            return start(body)
        _check_dashes()
        if wrong := refused_choice(sys.argv[1:], configs):
            raise SystemExit(f"{wrong}\n{HINT}")
        helps = bool({"--help", "-h"} & set(sys.argv[1:]))
        os.environ[FULL_ERROR] = "1"  # Hydra then raises what it would print in its own words
        try:
            if helps:
                print(sys.modules[body.__module__].__doc__, choices(configs, name), "", sep="\n")
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
            raise SystemExit(f"{in_words(error, configs, name, check)}\n{HINT}") from None
        finally:
            os.environ.pop(FULL_ERROR, None)

    return main


def _run(body: Body, config: DictConfig, name: str) -> None:
    try:
        body(config)
    except ValueError as error:
        if "HydraConfig was not set" not in str(error):
            raise
        raise InvalidValueError(
            f"{name} asks its command line: run it as python recipes/{name}.py"
        ) from error


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
