"""The way back home: what moves the arm to where every task begins, as actions that a policy can take.

Source: ours; the pose is that of docs/task.md, "Start of an episode".
"""

from __future__ import annotations

import torch
from torch import Tensor

from tstar_envs.robots import sawyer
from tstar_envs.tasks.retreat import joint_speeds, velocities_to

__all__ = ["ARRIVED", "way_home"]

ARRIVED = 0.05
"""Each joint is as near home as this, rad: a quarter of the noise of the starts at scale=no_return."""


def way_home(observation: Tensor, velocity_scale: float) -> tuple[Tensor, Tensor]:
    """One step of the straight way home in joint space, hand open. The arm can meet parts on it, and push them.

    Args:
        observation: (n, O); its first numbers are the joints, rad.
        velocity_scale: the setting of that name, the share of the joints' speeds that an action of 1 asks for.

    Returns:
        Actions (n, 9) in [-1, 1], and whether the arm has arrived, (n,) bool.
    """
    joints = observation[:, : sawyer.NUM_JOINTS].double()
    home = torch.tensor(sawyer.HOME_QPOS, dtype=torch.float64, device=joints.device)
    speeds = joint_speeds(velocity_scale, joints.device)
    action = torch.full(
        (len(joints), sawyer.NUM_JOINTS + 2), -1.0, device=joints.device
    )  # open, not connecting
    action[:, : sawyer.NUM_JOINTS] = (velocities_to(home, joints, speeds) / speeds).float()
    return action, (home - joints).abs().amax(-1) < ARRIVED
