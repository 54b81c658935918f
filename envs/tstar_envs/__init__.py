"""The world: furniture, robot, physics and the batched assembly task. No learning, no TorchRL.

Importing it gives Gymnasium an id for every piece of furniture; see `gymnasium_env`.
"""

from tstar_envs.gymnasium_env import register
from tstar_envs.registry import load, load_dm, names

__all__ = ["load", "load_dm", "names"]

register()
