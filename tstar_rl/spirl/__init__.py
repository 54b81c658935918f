"""SPiRL (Pertsch et al., CoRL 2020): latent actions and their prior from demonstrations, and a policy over them.

A latent z stands for H actions. SPiRL's authors call it a skill; in this library a skill is a link of a chain. The
names are imported when they are asked for, as those of `tstar_rl`.
"""

from typing import TYPE_CHECKING

from tstar_rl.deferred import deferred

if TYPE_CHECKING:
    from tstar_rl.spirl.agent import SpirlAgent, SpirlTraining
    from tstar_rl.spirl.latent_execution import LatentExecution, LatentPolicy
    from tstar_rl.spirl.model import LatentModelSettings
    from tstar_rl.spirl.model_training import ModelTrainingSettings, split_windows, train_latent_model
    from tstar_rl.spirl.policy_update import TRANSITION, LatentPolicySettings, LatentPolicyUpdate, new_buffer

HOMES = {
    "TRANSITION": "policy_update",
    "LatentExecution": "latent_execution",
    "LatentModelSettings": "model",
    "LatentPolicy": "latent_execution",
    "LatentPolicySettings": "policy_update",
    "LatentPolicyUpdate": "policy_update",
    "ModelTrainingSettings": "model_training",
    "SpirlAgent": "agent",
    "SpirlTraining": "agent",
    "new_buffer": "policy_update",
    "split_windows": "model_training",
    "train_latent_model": "model_training",
}
"""The module of each public name."""
__all__ = [
    "TRANSITION",
    "LatentExecution",
    "LatentModelSettings",
    "LatentPolicy",
    "LatentPolicySettings",
    "LatentPolicyUpdate",
    "ModelTrainingSettings",
    "SpirlAgent",
    "SpirlTraining",
    "new_buffer",
    "split_windows",
    "train_latent_model",
]

__getattr__ = deferred(__name__, HOMES)
