"""Specs of the furniture environment, and of any TensorDict whose shapes are known only at run time."""

from typing import Any, NamedTuple

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.data import Binary, Bounded, Categorical, Composite, Unbounded

from tstar_envs.tasks.actions import NUM_ACTIONS
from tstar_envs.tasks.phase_reward import PHASES

__all__ = ["DONE_KEYS", "FurnitureSpecs", "furniture_specs", "spec_of"]

DONE_KEYS = ("done", "terminated", "truncated")


class FurnitureSpecs(NamedTuple):
    """What a furniture environment reads and writes."""

    observation: Composite
    action: Bounded
    reward: Composite
    done: Composite


def furniture_specs(
    batch_size: torch.Size, num_observations: int, num_subtasks: int, snapshot: TensorDictBase | None
) -> FurnitureSpecs:
    """The specs of a furniture environment, on the CPU; the environment moves them.

    Args:
        batch_size: [N].
        num_observations: O.
        num_subtasks: of the task.
        snapshot: one of the environment's, batch [N]; None: it writes none.
    """
    one = torch.Size([*batch_size, 1])
    observation = {
        "observation": Unbounded(torch.Size([*batch_size, num_observations]), dtype=torch.float32),
        "subtask": Categorical(num_subtasks + 1, one, dtype=torch.int64),
        "phase": Categorical(len(PHASES), one, dtype=torch.int64),
        "completed": Categorical(num_subtasks + 1, one, dtype=torch.int64),
        "success": Binary(1, one, dtype=torch.bool),
    }
    if snapshot is not None:
        observation["snapshot"] = spec_of(snapshot)
    done = {name: Binary(1, one, dtype=torch.bool) for name in DONE_KEYS}
    return FurnitureSpecs(
        observation=Composite(observation, shape=batch_size),
        action=Bounded(-1.0, 1.0, torch.Size([*batch_size, NUM_ACTIONS]), dtype=torch.float32),
        reward=Composite({"reward_env": Unbounded(one, dtype=torch.float32)}, shape=batch_size),
        done=Composite(done, shape=batch_size),
    )


def spec_of(tensordict: TensorDictBase) -> Composite:
    """Specs of the shapes and types of all leaves, batch size and nesting as in `tensordict`."""
    leaves = {
        name: spec_of(value) if isinstance(value, TensorDictBase) else _leaf_spec(value)
        for name, value in tensordict.items()
    }
    return Composite(leaves, shape=tensordict.batch_size)


def _leaf_spec(value: Tensor) -> Any:
    if value.dtype == torch.bool:
        return Categorical(2, value.shape, dtype=torch.bool)  # Binary wants a last dimension of its own
    return Unbounded(value.shape, dtype=value.dtype)
