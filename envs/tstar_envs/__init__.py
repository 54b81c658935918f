"""The world: furniture, robot, physics and the batched assembly task. No learning, no TorchRL."""

from tstar_envs.dm_environment import load_dm
from tstar_envs.registry import load, names

__all__ = ["load", "load_dm", "names"]
