"""The loss of d_omega."""

from dataclasses import dataclass
from typing import ClassVar

from tensordict import TensorDict, TensorDictBase
from tensordict.utils import NestedKey
from torchrl.objectives import LossModule

from tstar_rl.equations import initiation_set_loss
from tstar_rl.models.networks import Discriminator
from tstar_rl.objectives.discriminator import score_and_penalty


class InitiationSetLoss(LossModule):
    """Least squares with labels 1 (initiation set of a skill) and 0 (termination set of the skill before).

    The loss is the sum of the entries whose names begin with "loss_".

    Args:
        network: d_omega, trained through this module's parameters and read by `TerminalStateReward`.
        gradient_penalty_weight: 0 (the paper) leaves the penalty out; the code released with it has 10.

    Source: the paper, L_i(omega) in section 3.3.
    """

    @dataclass
    class _AcceptedKeys:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Keys of the input: both (batch, O)."""

        initiation_observation: NestedKey = "initiation_observation"
        termination_observation: NestedKey = "termination_observation"

    default_keys = _AcceptedKeys
    tensor_keys: _AcceptedKeys  # pyright: ignore[reportIncompatibleMethodOverride]
    out_keys: ClassVar[list[str]] = [  # pyright: ignore[reportIncompatibleMethodOverride]
        "loss_initiation_set",
        "loss_gradient_penalty",
        "initiation_score",
        "termination_score",
    ]

    def __init__(self, network: Discriminator, gradient_penalty_weight: float = 0.0) -> None:
        super().__init__()
        if gradient_penalty_weight < 0:
            raise ValueError(f"gradient_penalty_weight must not be negative, got {gradient_penalty_weight}")
        self.network = network
        self.gradient_penalty_weight = gradient_penalty_weight

    def _forward_value_estimator_keys(self, **kwargs) -> None:
        pass

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """tensordict: "initiation_observation", "termination_observation" (batch, O) -> losses and mean scores."""
        initiation = self.network.normalize(tensordict.get(self.tensor_keys.initiation_observation)).detach()
        d_termination = self.network(tensordict.get(self.tensor_keys.termination_observation))
        d_initiation, penalty = score_and_penalty(self.network, initiation, self.gradient_penalty_weight)
        losses = {
            "loss_initiation_set": initiation_set_loss(d_initiation, d_termination),
            "loss_gradient_penalty": penalty,
            "initiation_score": d_initiation.detach().mean(),
            "termination_score": d_termination.detach().mean(),
        }
        return TensorDict(losses)
