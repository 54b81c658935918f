"""What changes networks: behaviour cloning, PPO, and the two discriminators.

An update is an object only because an optimiser has a memory; calling it with data is one update, and what it
returns goes into the log. Its `state_dict` makes a run resumable.
"""

from tstar_rl.updates.cloning import BehaviourCloningSettings, behaviour_cloning
from tstar_rl.updates.discriminator import (
    DiscriminatorSettings,
    DiscriminatorUpdate,
    make_d_omega_update,
    make_f_phi_update,
)
from tstar_rl.updates.policy import PolicyUpdate, PPOSettings
from tstar_rl.updates.return_scale import ReturnScale

__all__ = [
    "BehaviourCloningSettings",
    "DiscriminatorSettings",
    "DiscriminatorUpdate",
    "PPOSettings",
    "PolicyUpdate",
    "ReturnScale",
    "behaviour_cloning",
    "make_d_omega_update",
    "make_f_phi_update",
]
