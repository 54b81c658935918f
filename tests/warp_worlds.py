"""Worlds on Warp for tests: on its CPU device, and on a GPU where there is one (marker `gpu`)."""

import pytest
import torch

import tstar_envs
from tstar_envs.environment import BatchedEnvironment

warp = pytest.importorskip("warp", reason="the extra 'gpu' is not installed: pip install -e '.[gpu]'")
pytest.importorskip("mujoco_warp", reason="the extra 'gpu' is not installed: pip install -e '.[gpu]'")
if not torch.cuda.is_available():
    warp.config.optimization_level = 1  # the kernels compile in half a minute, not in minutes

DEVICES = ["cpu", pytest.param("cuda", marks=pytest.mark.gpu)]


def make(
    num_sims: int = 3, subtask: int | None = 0, seed: int = 0, device: str = "cpu", **settings
) -> BatchedEnvironment:
    world = tstar_envs.load(
        "table_lack", num_sims, subtask, 1, seed, device=device, physics="warp", **settings
    )
    world.reset()
    return world
