"""The world: furniture, robot, physics and the batched assembly task. No learning, no TorchRL."""

from tstar_envs.dm_environment import load_dm

__all__ = ["load_dm"]
