"""The update of a network that is to say a number of every state: an outcome, a proximity, a critic's error."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from tensordict import TensorDict
from torch import Tensor

from tstar_rl.checks import check_ranges
from tstar_rl.models.networks import Discriminator
from tstar_rl.models.normalizer import Standardizer
from tstar_rl.objectives import LabelledLoss
from tstar_rl.updates.sampled import SampledUpdate

__all__ = ["LabelledSettings", "LabelledUpdate"]


@dataclass(frozen=True)
class LabelledSettings:
    """How a network learns the labels of states; docs/decisions/0022-signals.md says what was tried."""

    learning_rate: float = 3e-4
    minibatch: int = 256
    steps: int = 128
    """Minibatches in one update."""
    weight_decay: float = 1e-2
    noise: float = 0.1
    """Deviation of what is added to the normalised observations in training."""
    floor: float | None = None
    """None: the network uses the normaliser of the skill whose outcomes it learns. A number: it standardises its input
    by the states that it learns from, with deviations floored at this, in the units of the observation."""

    def __post_init__(self) -> None:
        check_ranges(
            self,
            count=("minibatch", "steps"),
            positive=("learning_rate", "floor"),
            not_negative=("weight_decay", "noise"),
        )


class LabelledUpdate(SampledUpdate):
    """Some optimiser steps of a network on random minibatches of states and their labels.

        update = LabelledUpdate("feasibility", network, outcome_loss, LabelledSettings())
        log = update(outcomes.observations(), outcomes.labels("success"))

    Args:
        name: prefix of what is logged.
        network: trained in place. Its input's standardisation, if it has one, is fitted to the states of every update.
        distance: see `LabelledLoss`.
        settings: see `LabelledSettings`.
        seed: of minibatches and noise.
    """

    def __init__(
        self,
        name: str,
        network: Discriminator,
        distance: Callable[[Tensor, Tensor], Tensor],
        settings: LabelledSettings,
        seed: int = 0,
    ) -> None:
        self.name, self.settings = name, settings
        self.loss = LabelledLoss(network, distance)
        parameters, decay = self.loss.parameters(), settings.weight_decay
        super().__init__(torch.optim.AdamW(parameters, settings.learning_rate, weight_decay=decay), seed)

    def __call__(self, observations: Tensor, labels: Tensor) -> dict[str, float]:
        """Observations (n, O), labels (n,) -> mean loss, score and label, and n; nothing if n is 0.

        Raises:
            ValueError: if there is not one label for each observation.
        """
        if labels.shape != observations.shape[:1]:  # of (n, 1) each state would learn the mean of a minibatch
            raise ValueError(
                f"the update of {self.name} takes a label for each observation, (n,); got {len(observations)} "
                f"observations and labels {tuple(labels.shape)}"
            )
        if not len(labels):
            return {}
        if isinstance(self.loss.network.normalizer, Standardizer):
            self.loss.network.normalizer.standardize(observations)
        loss = score = torch.zeros((), device=self.device)
        for _ in range(self.settings.steps):
            out = self._step(observations, labels.to(torch.float32))
            loss, score = loss + out["loss_label"].detach(), score + out["score"]
        mean = {"loss": float(loss) / self.settings.steps, "score": float(score) / self.settings.steps}
        mean |= {"label": float(labels.double().mean()), "states": len(labels)}
        return {f"{self.name}_{key}": value for key, value in mean.items()}

    def _step(self, observations: Tensor, labels: Tensor) -> TensorDict:
        size, generator = self.settings.minibatch, self.generator
        rows = torch.randint(len(labels), (size,), generator=generator, device=self.device)
        batch = TensorDict({"observation": observations[rows], "label": labels[rows].unsqueeze(-1)}, [size])
        if self.settings.noise:
            shape = batch["observation"].shape
            noise = torch.randn(shape, generator=generator, device=self.device)
            batch["noise"] = self.settings.noise * noise
        out = self.loss(batch)
        self.optimizer.zero_grad()
        out["loss_label"].backward()
        self.optimizer.step()
        return out
