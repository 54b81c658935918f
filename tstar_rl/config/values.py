"""The folder of configs, and plain values and settings of what was read from it. No torch."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from omegaconf import DictConfig, OmegaConf

from tstar_rl.checks import did_you_mean
from tstar_rl.config.check import ConfigError, check

__all__ = ["CONFIGS", "plain", "settings", "task_section"]

CONFIGS = Path(__file__).resolve().parents[2] / "configs"

Settings = TypeVar("Settings")


def plain(config: DictConfig) -> dict[str, Any]:
    """The config as nested plain values."""
    return OmegaConf.to_container(config, resolve=True, throw_on_missing=True)  # type: ignore[return-value]


def task_section(name: str) -> DictConfig:
    """The values of configs/task/<name>.yaml.

    Raises:
        ConfigError: if there is no such file; it lists those that there are.
    """
    files = {path.stem: path for path in sorted((CONFIGS / "task").glob("*.yaml"))}
    if name not in files:
        valid = f"{', '.join(files)} (files of configs/task)"
        raise ConfigError(f"a task must be one of {valid}, got {name!r}{did_you_mean(name, files)}")
    return OmegaConf.load(files[name])  # pyright: ignore[reportReturnType]


def settings(kind: type[Settings], section: Mapping[str, Any] | DictConfig) -> Settings:
    """A frozen settings object from a section of the config.

    Raises:
        ConfigError: for a name that `kind` does not have, or a value of another type.
    """
    values = (
        OmegaConf.to_container(section, resolve=True) if isinstance(section, DictConfig) else dict(section)
    )
    assert isinstance(values, dict)
    check({str(name): value for name, value in values.items()}, kind, kind.__name__)
    return kind(**{str(k): tuple(v) if isinstance(v, list) else v for k, v in values.items()})
