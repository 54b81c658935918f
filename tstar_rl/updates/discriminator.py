"""The updates of the two discriminators, f_phi and d_omega."""

from dataclasses import dataclass, field
from typing import Any

import torch
from tensordict import TensorDict
from torch import Tensor
from torchrl.objectives import LossModule

from tstar_rl.checks import check_ranges
from tstar_rl.models.networks import Discriminator
from tstar_rl.objectives import GAILDiscriminatorLoss, InitiationSetLoss


@dataclass(frozen=True)
class DiscriminatorSettings:
    """Source: docs/task.md, "Training figures"; the size of an update is the implementation's."""

    learning_rate: float = 1e-4
    minibatch: int = 128
    steps: int = 100
    """Minibatches in one update, drawn at random: a subsample of a large rollout."""
    gradient_penalty: float = 10.0

    def __post_init__(self) -> None:
        check_ranges(
            self,
            count=("minibatch", "steps"),
            positive=("learning_rate",),
            not_negative=("gradient_penalty",),
        )


@dataclass
class DiscriminatorUpdate:
    """Some optimiser steps of a discriminator's loss on random minibatches of two sets of observations.

    Args:
        loss: reads the two keys; entries beginning with "loss_" are summed.
        keys: of the positive observations and the negative ones.
        settings: see `DiscriminatorSettings`.
        name: prefix of what is logged.
        seed: of the minibatches.
    """

    loss: LossModule
    keys: tuple[str, str]
    settings: DiscriminatorSettings
    name: str
    seed: int = 0
    optimizer: torch.optim.Optimizer = field(init=False)
    device: torch.device = field(init=False)
    generator: torch.Generator = field(init=False)

    def __post_init__(self) -> None:
        self.optimizer = torch.optim.Adam(self.loss.parameters(), self.settings.learning_rate)
        self.device = next(self.loss.parameters()).device
        self.generator = torch.Generator(self.device).manual_seed(self.seed)

    def __call__(self, positive: Tensor, negative: Tensor) -> dict[str, float]:
        """positive: (..., O), negative: (..., O) -> mean loss and scores; nothing if either is empty."""
        sets = [rows.reshape(-1, rows.shape[-1]) for rows in (positive, negative)]
        if not all(len(rows) for rows in sets):
            return {}
        sums: dict[str, Tensor] = {}
        for _ in range(self.settings.steps):
            draws = [rows[self._draw(len(rows))] for rows in sets]
            out = self.loss(TensorDict(dict(zip(self.keys, draws, strict=True)), [self.settings.minibatch]))
            loss = torch.stack([value for key, value in out.items() if key.startswith("loss_")]).sum()
            self.optimizer.zero_grad()
            loss.backward()
            self.optimizer.step()
            for key, value in out.items():
                sums[key] = sums.get(key, 0.0) + value.detach()
        return {f"{self.name}_{key}": float(value) / self.settings.steps for key, value in sums.items()}

    def _draw(self, rows: int) -> Tensor:
        """The rows of a minibatch, of so many."""
        size = (self.settings.minibatch,)
        return torch.randint(rows, size, generator=self.generator, device=self.device)

    def state_dict(self) -> dict[str, Any]:
        """Optimiser and generator."""
        return {
            "optimizer": self.optimizer.state_dict(),
            "generator": self.generator.get_state(),
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """What `state_dict` gave."""
        self.optimizer.load_state_dict(state["optimizer"])
        self.generator.set_state(state["generator"])


def make_f_phi_update(
    f_phi: Discriminator, settings: DiscriminatorSettings, seed: int = 0
) -> DiscriminatorUpdate:
    """Called with (expert observations, the agent's)."""
    loss = GAILDiscriminatorLoss(f_phi, settings.gradient_penalty)
    return DiscriminatorUpdate(loss, ("expert_observation", "observation"), settings, "f_phi", seed)


def make_d_omega_update(
    d_omega: Discriminator, settings: DiscriminatorSettings, seed: int = 0
) -> DiscriminatorUpdate:
    """Called with (initiation set of the skill, termination set of the skill before)."""
    loss = InitiationSetLoss(d_omega, settings.gradient_penalty)
    keys = ("initiation_observation", "termination_observation")
    return DiscriminatorUpdate(loss, keys, settings, "d_omega", seed)
