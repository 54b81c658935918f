"""SPiRL (Pertsch et al., CoRL 2020): latent actions and their prior from demonstrations, and a policy over them.

A latent z stands for H actions. SPiRL's authors call it a skill; in this library a skill is a link of a chain.
"""

from tstar_rl.spirl.agent import SpirlAgent, SpirlTraining
from tstar_rl.spirl.latent_execution import LatentExecution, LatentPolicy
from tstar_rl.spirl.model import LatentModelSettings
from tstar_rl.spirl.model_training import ModelTrainingSettings, split_windows, train_latent_model
from tstar_rl.spirl.policy_update import TRANSITION, LatentPolicySettings, LatentPolicyUpdate

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
    "split_windows",
    "train_latent_model",
]
