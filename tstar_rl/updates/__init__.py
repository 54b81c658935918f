"""What changes networks: behaviour cloning, PPO, the two discriminators, and SPiRL's skill model and policy.

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
from tstar_rl.updates.skill_model import SkillModelTraining, held_out_windows, train_skill_model
from tstar_rl.updates.skill_policy import SkillPolicySettings, SkillPolicyUpdate

__all__ = [
    "BehaviourCloningSettings",
    "DiscriminatorSettings",
    "DiscriminatorUpdate",
    "PPOSettings",
    "PolicyUpdate",
    "ReturnScale",
    "SkillModelTraining",
    "SkillPolicySettings",
    "SkillPolicyUpdate",
    "behaviour_cloning",
    "held_out_windows",
    "make_d_omega_update",
    "make_f_phi_update",
    "train_skill_model",
]
