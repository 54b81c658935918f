"""What the entries of an action are: joint velocities, the gripper, and whether to connect; each in [-1, 1]."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from torch import Tensor

from tstar_envs.robots import sawyer

NUM_ACTIONS = sawyer.NUM_JOINTS + 2
GRIPPER, CONNECT = sawyer.NUM_JOINTS, sawyer.NUM_JOINTS + 1


def array_of_actions(name: str, values: Any, shape: tuple[int, ...]) -> Tensor:
    """Actions of the task `name`, as numbers or an array of `shape`, as a float64 tensor of their own.

    Raises:
        ValueError: they have another shape.
    """
    actions = np.array(values, dtype=np.float64)
    if actions.shape != shape:
        raise ValueError(
            f"an action of {name} has shape {shape} here: 7 joint velocities, gripper, connect; got {actions.shape}"
        )
    return torch.from_numpy(actions)


def read_actions(name: str, action: Tensor, num_sims: int, device: torch.device) -> Tensor:
    """Actions (N, 9) of the task `name` in [-1, 1], float64, on the device of its simulations.

    Raises:
        ValueError: they are no tensor of real numbers, have another shape, or one is NaN.
    """
    if not isinstance(action, Tensor) or action.is_complex():
        kind = action.dtype if isinstance(action, Tensor) else type(action).__name__
        raise ValueError(f"an action of {name} is a tensor of real numbers, got {kind}")
    if action.shape != (num_sims, NUM_ACTIONS):
        raise ValueError(
            f"an action of {name} has shape ({num_sims}, {NUM_ACTIONS}): 7 joint velocities, gripper, "
            f"connect for each simulation; got {tuple(action.shape)}"
        )
    action = action.to(device, torch.float64).clamp(-1.0, 1.0)
    if math.isnan(float(action.sum())):  # they are clipped, so no sum of numbers is
        bad = action.isnan().any(dim=-1)
        raise ValueError(f"an action of {name} is NaN in simulations {bad.nonzero().flatten().tolist()[:8]}")
    return action


def read_mask(name: str, running: Tensor, num_sims: int, device: torch.device) -> Tensor:
    """Which simulations of the task `name` are meant, (N,) bool on their device: those that run, or that are reset.

    Raises:
        ValueError: it is of another shape or type.
    """
    if not isinstance(running, Tensor):
        raise ValueError(
            f"which simulations of {name} are meant is a mask of shape ({num_sims},), torch.bool; got {running!r}"
        )
    if running.shape != (num_sims,) or running.dtype != torch.bool:
        raise ValueError(
            f"which simulations of {name} are meant is a mask of shape ({num_sims},), torch.bool; "
            f"got {tuple(running.shape)}, {running.dtype}"
        )
    return running.to(device)
