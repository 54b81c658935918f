"""The losses of the two discriminators and of SPiRL, as TorchRL loss modules."""

from tstar_rl.objectives.discriminator import GAILDiscriminatorLoss
from tstar_rl.objectives.initiation_set import InitiationSetLoss
from tstar_rl.objectives.prior_regularised_sac import PriorRegularisedSACLoss
from tstar_rl.objectives.skill_model import SkillModelLoss

__all__ = ["GAILDiscriminatorLoss", "InitiationSetLoss", "PriorRegularisedSACLoss", "SkillModelLoss"]
