"""Environments by the name of their furniture: a file in `furniture/data` is a task, nothing is registered by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import torch

from tstar_envs.environment import BatchedEnvironment
from tstar_envs.furniture.library import names
from tstar_envs.settings import TaskSettings

if TYPE_CHECKING:
    from tstar_envs.dm_environment import DmEnvironment

__all__ = ["load", "load_dm", "names"]


def load(
    name: str,
    num_sims: int = 1,
    subtask: int | None = None,
    nthread: int = 0,
    seed: int | None = None,
    device: str | torch.device = "cpu",
    physics: str | None = None,
    **settings: Any,
) -> BatchedEnvironment:
    """Makes `num_sims` simulations of the assembly of furniture `name`; call its `reset` to begin.

    Args:
        name: one of `names()`.
        num_sims: simulations N.
        subtask: step of the recipe, 0-based, or None for the whole task.
        nthread: threads that step the simulations, 0 for all cores.
        seed: of the private random generator of start noise; None draws one.
        device: where the simulations are, `cpu` or `cuda`.
        physics: `mujoco` or `warp`; None takes what simulates on `device` best.
        **settings: `tstar_envs.settings.TaskSettings` by name.

    Raises:
        ValueError: unknown furniture, subtask, device or simulator, or a setting or number that cannot be; the message
            says what is valid.
        TypeError: a keyword that is no setting.
        ImportError: `warp` without the extra `gpu`.
    """
    chosen = TaskSettings.from_keywords("load", settings)
    return BatchedEnvironment(name, num_sims, subtask, nthread, seed, chosen, device, physics)


def load_dm(task: str, subtask: int | None = None, seed: int | None = None, **settings: Any) -> DmEnvironment:
    """Returns one simulation of an assembly task as dm_control's `Environment`; see `dm_environment`.

    Args:
        task: furniture, e.g. `table_lack`.
        subtask: step of the recipe, 0-based; None for the whole task.
        seed: of the start noise; None draws one.
        **settings: fields of `tstar_envs.settings.TaskSettings`.

    Raises:
        ValueError: unknown furniture or subtask, or a setting that cannot be.
        TypeError: a keyword that is no setting.
    """
    from tstar_envs import dm_environment  # dm_control takes a second to import: only who asks for it waits

    return dm_environment.make(task, subtask, seed, settings)
