"""Sizes of a skill's networks, and how far its actions spread."""

from dataclasses import dataclass

from torch import nn

from tstar_rl.checks import check_choices, check_ranges, check_sizes

__all__ = ["ACTIVATIONS", "NetworkSettings"]

ACTIVATIONS = {"relu": nn.ReLU, "tanh": nn.Tanh}


@dataclass(frozen=True)
class NetworkSettings:
    """Source: the paper's appendix B for the nonlinearities and the discriminators' sizes; the rest is ours.

    Raises:
        InvalidValueError: for a size or deviation out of its range, or an unknown activation or kind of deviation.
    """

    hidden: tuple[int, ...] = (128, 256)
    """Sizes of the hidden layers of the policy."""
    value_hidden: tuple[int, ...] | None = None
    """Those of the value network; None: as the policy's."""
    activation: str = "relu"
    """Between them: `relu` or `tanh`."""
    std: str = "state"
    """Of the actions: `state`, learned and given by the policy; `fixed`, as `exploration` says."""
    action_std: float = 0.1
    """Deviation of the joint velocities, in units of the action (1 is full speed); with std=state at the beginning."""
    hand_std: float = 0.1
    """Deviation of the gripper and connect actions."""
    features: bool = False
    """Whether policy and value also see `RelativeFeatures`; else they see the observation alone."""
    discriminator_hidden: tuple[int, ...] = (256, 256)
    """Sizes of the hidden layers of f_phi, d_omega and further networks of scores."""
    discriminator_activation: str = "tanh"
    """Between these."""

    def __post_init__(self) -> None:
        check_ranges(self, positive=("action_std", "hand_std"))
        check_choices(
            self, activation=ACTIVATIONS, discriminator_activation=ACTIVATIONS, std=("state", "fixed")
        )
        check_sizes(self, "hidden", "value_hidden", "discriminator_hidden")
