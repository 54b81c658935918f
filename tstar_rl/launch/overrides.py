"""What this recipe's command line has for the recipes that it starts."""

from collections.abc import Container

from hydra.core.hydra_config import HydraConfig

from tstar_rl.config.overrides import section_of

__all__ = ["chosen_scale", "config_folders", "passed_on"]


def passed_on(own: Container[str]) -> list[str]:
    """The values on this recipe's command line that the recipes which it starts are given too.

    Args:
        own: keys and sections that only this recipe knows; values of these are left out, and launch, for the recipes
            that are started start none.
    """
    given = HydraConfig.get().overrides.task
    return [value for value in given if section_of(value) not in own and section_of(value) != "launch"]


def config_folders() -> list[str]:
    """Hydra's --config-dir of this process, as arguments: a recipe that another starts finds the same files.

    Nothing outside of a recipe.
    """
    if not HydraConfig.initialized():
        return []
    given = (each for each in HydraConfig.get().runtime.config_sources if each.provider == "command-line")
    return [f"--config-dir={each.path}" for each in given]


def chosen_scale() -> str:
    """The scale that this recipe's command line has chosen, or its config's default."""
    return HydraConfig.get().runtime.choices["scale"]
