"""Losses as TorchRL loss modules."""

from tstar_rl.objectives.discriminator import DiscriminatorLoss

__all__ = ["DiscriminatorLoss"]
