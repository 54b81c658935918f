"""The loss of f_phi."""

from dataclasses import dataclass
from typing import ClassVar

import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.utils import NestedKey
from torch import Tensor
from torchrl.objectives import LossModule

from tstar_rl.equations import gail_discriminator_loss, gradient_penalty
from tstar_rl.models.networks import Discriminator


class GAILDiscriminatorLoss(LossModule):
    """Least squares with labels +1 (expert) and -1 (agent), and a gradient penalty at the expert's states.

    The gradient is taken with respect to the *normalised* observation: with respect to the raw one it would weigh a
    dimension by how little it varies. The loss is the sum of the entries whose names begin with "loss_".

    Args:
        network: f_phi, trained through this module's parameters and read by `GAILReward`.
        gradient_penalty_weight: 0 leaves the penalty out.

    Source: the paper, text below eq. 1; AMP eq. 8; weight 10 from AMP.
    """

    @dataclass
    class _AcceptedKeys:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Keys of the input: both (batch, O)."""

        observation: NestedKey = "observation"
        expert_observation: NestedKey = "expert_observation"

    default_keys = _AcceptedKeys
    tensor_keys: _AcceptedKeys  # pyright: ignore[reportIncompatibleMethodOverride]
    out_keys: ClassVar[list[str]] = [  # pyright: ignore[reportIncompatibleMethodOverride]
        "loss_discriminator",
        "loss_gradient_penalty",
        "expert_score",
        "agent_score",
    ]

    def __init__(self, network: Discriminator, gradient_penalty_weight: float = 10.0) -> None:
        super().__init__()
        if gradient_penalty_weight < 0:
            raise ValueError(f"gradient_penalty_weight must not be negative, got {gradient_penalty_weight}")
        self.network = network
        self.gradient_penalty_weight = gradient_penalty_weight

    def _forward_value_estimator_keys(self, **kwargs) -> None:
        pass

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """tensordict: "observation" and "expert_observation" (batch, O) -> losses and mean scores, scalars."""
        expert = self.network.normalize(tensordict.get(self.tensor_keys.expert_observation)).detach()
        f_agent = self.network(tensordict.get(self.tensor_keys.observation))
        f_expert, penalty = score_and_penalty(self.network, expert, self.gradient_penalty_weight)
        losses = {
            "loss_discriminator": gail_discriminator_loss(f_expert, f_agent),
            "loss_gradient_penalty": penalty,
            "expert_score": f_expert.detach().mean(),
            "agent_score": f_agent.detach().mean(),
        }
        return TensorDict(losses)


def score_and_penalty(network: Discriminator, normalized: Tensor, weight: float) -> tuple[Tensor, Tensor]:
    """normalized: (batch, D) -> raw scores (batch, 1) and the weighted gradient penalty there, a scalar."""
    if not weight:
        return network.score(normalized), normalized.new_zeros(())
    normalized = normalized.requires_grad_()
    scores = network.score(normalized)
    (grad,) = torch.autograd.grad(scores.sum(), normalized, create_graph=True)
    return scores, weight * gradient_penalty(grad)
