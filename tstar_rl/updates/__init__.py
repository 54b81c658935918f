"""What changes networks: behaviour cloning, PPO, the discriminators, and networks that learn the labels of states.

An update is an object only because an optimiser has a memory; calling it with data is one update, and what it
returns goes into the log. Its `state_dict` makes a run resumable.
"""

from tstar_rl.updates.cloning import BehaviourCloningSettings, behaviour_cloning
from tstar_rl.updates.discriminator import DiscriminatorSettings, DiscriminatorUpdate
from tstar_rl.updates.labelled import LabelledSettings, LabelledUpdate
from tstar_rl.updates.ppo import PolicyUpdate
from tstar_rl.updates.ppo_settings import PPOSettings

__all__ = [
    "BehaviourCloningSettings",
    "DiscriminatorSettings",
    "DiscriminatorUpdate",
    "LabelledSettings",
    "LabelledUpdate",
    "PPOSettings",
    "PolicyUpdate",
    "behaviour_cloning",
]
