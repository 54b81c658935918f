"""Losses as TorchRL loss modules."""

from tstar_rl.objectives.discriminator import DiscriminatorLoss
from tstar_rl.objectives.labelled import LabelledLoss

__all__ = ["DiscriminatorLoss", "LabelledLoss"]
