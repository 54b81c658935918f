"""Batches of the assembly task for tests, one episode of them, and where their parts are."""

import mujoco
import numpy as np
import torch
from torch import Tensor

import tstar_envs
from tstar_envs import geometry
from tstar_envs.environment import BatchedEnvironment

PIECES = ("table_lack", "chair_ingolf")


def make(
    num_sims: int = 4, subtask: int | None = 0, seed: int = 0, name: str = "table_lack", **settings
) -> BatchedEnvironment:
    world = tstar_envs.load(name, num_sims, subtask, 1, seed, **settings)
    world.reset()
    return world


def run(world: BatchedEnvironment, act) -> tuple[Tensor, Tensor]:
    """One episode of every simulation: success (N,) and undiscounted return (N,), on the CPU."""
    running = torch.ones(world.num_sims, dtype=torch.bool, device=world.physics.device)
    success, returns = torch.zeros_like(running), torch.zeros_like(running, dtype=torch.float64)
    while running.any():
        world.step(act(world.state))
        returns += world.state["reward"] * running
        success |= world.state["success"] & running
        terminated, truncated = world.task.get_termination(world.state)
        running &= ~(terminated | truncated)
    return success.cpu(), returns.cpu()


def relative_poses(world: BatchedEnvironment, step: int) -> Tensor:
    """(N, 7) of the moving part in its target's frame."""
    tables, poses = world.task.tables, world.task.part_poses
    target, moving = poses[:, tables.target[step]], poses[:, tables.moving[step]]
    return torch.cat(
        geometry.relative_pose(target[:, :3], target[:, 3:], moving[:, :3], moving[:, 3:]), dim=-1
    )


def part_pose(world: BatchedEnvironment, name: str) -> Tensor:
    """Pose of a part, (N, 7), world: a live view of the simulations' `qpos`."""
    address = world.model.jnt_qposadr[world.model.joint(name).id]
    return world.physics.qpos[:, address : address + 7]


def site_pose(world: BatchedEnvironment, name: str) -> tuple[Tensor, Tensor]:
    """Position (N, 3), m, world, and rotation matrix (N, 3, 3) of a site, by MuJoCo's kinematics of `qpos`."""
    data, found = mujoco.MjData(world.model), []
    for qpos in world.physics.qpos.cpu().numpy():
        data.qpos[:] = qpos
        mujoco.mj_kinematics(world.model, data)
        site = data.site(name)
        found.append((site.xpos.copy(), site.xmat.reshape(3, 3).copy()))
    position, matrix = (torch.from_numpy(np.stack(each)) for each in zip(*found, strict=True))
    return position, matrix


IDLE = torch.tensor([0.0] * 7 + [-1.0, -1.0], dtype=torch.float64)


def idle(world: BatchedEnvironment) -> Tensor:
    return IDLE.repeat(world.num_sims, 1)


def aligned(world: BatchedEnvironment) -> Tensor:
    return world.task.scene(world.state).alignment.aligned
