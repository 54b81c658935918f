"""Which simulator runs where, by name."""

from __future__ import annotations

import mujoco
import torch

from tstar_envs.physics.cpu import CpuPhysics
from tstar_envs.physics.view import PhysicsView

NAMES = ("mujoco", "warp")


def make_physics(
    model: mujoco.MjModel,
    num_sims: int,
    nthread: int = 0,
    device: str | torch.device = "cpu",
    name: str | None = None,
) -> PhysicsView:
    """Makes `num_sims` simulations of `model` on `device`.

    Args:
        model: the compiled scene.
        num_sims: simulations N.
        nthread: threads of `mujoco`, 0 for all cores.
        device: `cpu`, or a CUDA device.
        name: `mujoco` (the processor, double precision) or `warp` (a GPU, single precision; on `cpu` slowly, for
            tests). None: `mujoco` on the processor, `warp` on a GPU.

    Raises:
        ValueError: unknown device or simulator, or `mujoco` on a GPU.
        ImportError: `warp` without the extra `gpu`.
    """
    try:
        kind = torch.device(device).type
    except (RuntimeError, TypeError):  # torch's message lists all that it was ever built for
        kind = None
    if kind not in ("cpu", "cuda"):
        raise ValueError(f"simulations run on device 'cpu' or 'cuda', got {str(device)!r}")
    name = name or ("mujoco" if kind == "cpu" else "warp")
    if name not in NAMES:
        raise ValueError(f"physics must be one of {', '.join(NAMES)} or None, got {name!r}")
    if name == "warp":
        from tstar_envs.physics.warp import WarpPhysics  # an extra: imported only where it is asked for

        return WarpPhysics(model, num_sims, device)
    if kind == "cuda":
        raise ValueError("physics 'mujoco' runs on device 'cpu'; on a GPU leave physics out, or name 'warp'")
    return CpuPhysics(model, num_sims, nthread)
