"""The loss of the skill model."""

from dataclasses import dataclass
from typing import ClassVar

import torch
from tensordict import TensorDict, TensorDictBase
from tensordict.utils import NestedKey
from torchrl.objectives import LossModule

from tstar_rl.equations import (
    skill_prior_loss,
    skill_reconstruction_loss,
    skill_regularisation_loss,
)
from tstar_rl.spirl.skill_model import SkillModel


class SkillModelLoss(LossModule):
    """A beta variational autoencoder of windows of actions, and the prior that follows its stopped posterior.

    The loss is the sum of the entries whose names begin with "loss_".

    Args:
        model: trained through this module's parameters.
        beta: weight of the posterior's divergence from a unit Gaussian.

    Source: SPiRL, eq. 1 and section 3.2.
    """

    @dataclass
    class _AcceptedKeys:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Keys of the input: (batch, H, 9) and (batch, H, O)."""

        action: NestedKey = "action"
        observation: NestedKey = "observation"

    default_keys = _AcceptedKeys
    tensor_keys: _AcceptedKeys  # pyright: ignore[reportIncompatibleMethodOverride]
    out_keys: ClassVar[list[str]] = [  # pyright: ignore[reportIncompatibleMethodOverride]
        "loss_reconstruction",
        "loss_regularisation",
        "loss_prior",
    ]

    def __init__(self, model: SkillModel, beta: float = 5e-4) -> None:
        super().__init__()
        if beta < 0:
            raise ValueError(f"beta must not be negative, got {beta}")
        self.model = model
        self.beta = beta

    def _forward_value_estimator_keys(self, **kwargs) -> None:
        pass

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """tensordict: windows (batch) -> losses, scalars; "loss_prior" is the divergence of posterior from prior."""
        actions = tensordict.get(self.tensor_keys.action)
        observations = tensordict.get(self.tensor_keys.observation)
        posterior = self.model.posterior(actions)
        prior = self.model.prior(observations[:, 0])
        skill = posterior[0] + posterior[1] * torch.randn_like(posterior[1])
        decoded = self.model.decoder.decode(skill, observations)
        losses = {
            "loss_reconstruction": skill_reconstruction_loss(decoded, actions),
            "loss_regularisation": skill_regularisation_loss(*posterior, self.beta),
            "loss_prior": skill_prior_loss(*posterior, *prior),
        }
        return TensorDict(losses)
