"""The losses of the discriminators, as TorchRL loss modules."""

from tstar_rl.objectives.discriminator import GAILDiscriminatorLoss
from tstar_rl.objectives.initiation_set import InitiationSetLoss

__all__ = ["GAILDiscriminatorLoss", "InitiationSetLoss"]
