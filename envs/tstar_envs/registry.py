"""Environments by the name of their furniture: a file in `furniture/data` is a task, nothing is registered by hand."""

from __future__ import annotations

from typing import Any

import torch

from tstar_envs.environment import BatchedEnvironment
from tstar_envs.furniture.library import names

__all__ = ["load", "names"]


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
        ValueError: unknown furniture, subtask, device, simulator or setting, or a number that cannot be; the message
            says what is valid.
    """
    return BatchedEnvironment(name, num_sims, subtask, nthread, seed, settings, device, physics)
