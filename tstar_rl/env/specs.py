"""Specs of the values at hand, where an environment cannot know their shapes before it has them."""

from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.data import Binary, Composite, Unbounded

__all__ = ["spec_of"]


def spec_of(tensordict: TensorDictBase) -> Composite:
    """Specs of the shapes and types of all leaves, batch size and nesting as in `tensordict`."""
    leaves = {
        name: spec_of(value) if isinstance(value, TensorDictBase) else _leaf_spec(value)
        for name, value in tensordict.items()
    }
    return Composite(leaves, shape=tensordict.batch_size)


def _leaf_spec(value: Tensor) -> Any:
    if value.dtype == torch.bool:
        return Binary(value.shape[-1], value.shape, dtype=torch.bool)
    return Unbounded(value.shape, dtype=value.dtype)
