"""A skill of small networks for tests of updates, and what its networks hold."""

import torch

from tstar_rl.chaining.skill import Skill
from tstar_rl.models.network_settings import NetworkSettings

SMALL = NetworkSettings(hidden=(32, 32), std="fixed", action_std=0.3, hand_std=0.3)


def small_skill() -> Skill:
    torch.manual_seed(0)
    return Skill("point", 0, SMALL, obs_dim=72)


def state_of(module: torch.nn.Module) -> dict[str, torch.Tensor]:
    return {key: value.clone() for key, value in module.state_dict().items()}


def same(a: dict[str, torch.Tensor], b: dict[str, torch.Tensor]) -> bool:
    return all(torch.equal(a[key], b[key]) for key in a)
