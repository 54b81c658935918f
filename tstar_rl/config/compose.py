"""The config of a recipe without its command line: in a notebook, a test, a program of one's own."""

from functools import partial

from hydra import compose as hydra_compose
from hydra import initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

from tstar_rl.checks import InvalidValueError, did_you_mean
from tstar_rl.config.check import ConfigError
from tstar_rl.config.load import check_config
from tstar_rl.config.mistakes import in_words, refused_choice
from tstar_rl.config.values import CONFIGS

__all__ = ["compose"]


def compose(recipe: str, *values: str) -> DictConfig:
    """The checked config that `python recipes/<recipe>.py <values>` would run with.

    Args:
        recipe: of the library, by name.
        values: as on the command line: "seed=1", "chain.rounds=2".

    Raises:
        InvalidValueError: if there is no such recipe, or no clone.
        ConfigError: for a value that the command line would refuse, in the same words.
    """
    if not CONFIGS.is_dir():
        raise InvalidValueError(f"recipes need a clone, installed with pip install -e: there is no {CONFIGS}")
    known = sorted(path.stem for path in (CONFIGS / "recipe").glob("*.yaml"))
    if recipe not in known:
        raise InvalidValueError(
            f"no recipe is called {recipe!r}: {', '.join(known)}{did_you_mean(recipe, known)}"
        )
    if wrong := refused_choice(values, CONFIGS):
        raise ConfigError(wrong)
    around = GlobalHydra.instance().hydra  # of a program that has configs of its own
    GlobalHydra.instance().clear()
    try:
        with initialize_config_dir(str(CONFIGS), version_base="1.3"):
            config = hydra_compose(f"recipe/{recipe}", list(values))
    except (HydraException, OmegaConfBaseException) as error:
        check = partial(check_config, name=recipe)
        raise ConfigError(in_words(error, CONFIGS, recipe, check, values)) from None
    finally:
        GlobalHydra.instance().hydra = around
    check_config(config, recipe)
    return config
