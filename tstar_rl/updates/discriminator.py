"""The update of a discriminator: f_phi, d_omega, or another network that scores states."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from tensordict import TensorDict
from torch import Tensor

from tstar_rl.checks import InvalidValueError, check_choices, check_ranges
from tstar_rl.models.networks import Discriminator
from tstar_rl.objectives import DiscriminatorLoss
from tstar_rl.signal_equations import two_sided_loss
from tstar_rl.updates.sampled import SampledUpdate

PENALTIES = ("zero_at_first", "one_between")


@dataclass(frozen=True)
class DiscriminatorSettings:
    """Source: docs/task.md, "Training figures"; the size of an update is the implementation's."""

    learning_rate: float = 1e-4
    minibatch: int = 128
    steps: int = 100
    """Minibatches in one update, drawn at random: a subsample of a large rollout."""
    gradient_penalty: float = 10.0
    """Weight of the gradient penalty."""
    penalty: str = "zero_at_first"
    """One of `PENALTIES`: "zero_at_first" pulls the gradient to zero at states of the first label (AMP), "one_between"
    its norm to one at random points between states of both labels (the released code); see `DiscriminatorLoss`."""
    bfloat16: bool = False
    """Whether the network computes in bfloat16, in its reward too; its parameters and its optimiser stay in float32."""

    def __post_init__(self) -> None:
        check_ranges(
            self,
            count=("minibatch", "steps"),
            positive=("learning_rate",),
            not_negative=("gradient_penalty",),
        )
        check_choices(self, penalty=PENALTIES)
        if self.penalty == "one_between" and not self.gradient_penalty:
            raise InvalidValueError(
                "DiscriminatorSettings.penalty must be zero_at_first where gradient_penalty is 0 (there is no "
                f"penalty), got {self.penalty}"
            )


class DiscriminatorUpdate(SampledUpdate):
    """Some optimiser steps of a discriminator on random minibatches of two kinds of observations.

        update_f_phi = DiscriminatorUpdate("f_phi", f_phi, {"expert": 1.0, "agent": -1.0}, settings)
        log = update_f_phi(expert=expert.observations, agent=rollout["observation"])

    Args:
        name: prefix of what is logged.
        network: trained in place.
        labels: what it should say of each of two kinds of states; see `DiscriminatorLoss`.
        settings: see `DiscriminatorSettings`.
        seed: of the minibatches.
    """

    def __init__(
        self,
        name: str,
        network: Discriminator,
        labels: Mapping[str, float],
        settings: DiscriminatorSettings,
        seed: int = 0,
    ) -> None:
        self.name, self.settings = name, settings
        network.coarse = settings.bfloat16
        self.loss = DiscriminatorLoss(network, labels, settings.gradient_penalty)
        super().__init__(torch.optim.Adam(self.loss.parameters(), settings.learning_rate), seed)

    def __call__(self, **observations: Tensor) -> dict[str, float]:
        """Observations (..., O) of each kind, by its label's name -> mean losses and scores; nothing if one is empty.

        Raises:
            TypeError: if these are not the kinds that there are labels of.
        """
        return self.on_sides([observations], weight=1.0)

    def on_sides(self, sides: Sequence[Mapping[str, Tensor]], weight: float = 0.5) -> dict[str, float]:
        """One network at several seams: each minibatch has states of all sides, whose losses count `weight` each.

        Args:
            sides: observations (..., O) of each kind, by its label's name. One in which a kind is empty is left out.
            weight: see `signal_equations.two_sided_loss`.

        Returns:
            Losses and scores, the mean over minibatches and sides; nothing if no side is left.

        Raises:
            TypeError: if a side has not the kinds that there are labels of.
        """
        sets = [self._flat(side) for side in sides]
        sets = [side for side in sets if all(len(rows) for rows in side.values())]
        if not sets:
            return {}
        sums: dict[str, Tensor] = {}
        for _ in range(self.settings.steps):
            for out in self._step(sets, weight):
                for key, value in out.items():
                    sums[key] = sums.get(key, 0.0) + value.detach()
        number = self.settings.steps * len(sets)
        return {f"{self.name}_{key}": float(value) / number for key, value in sums.items()}

    def _flat(self, side: Mapping[str, Tensor]) -> dict[str, Tensor]:
        if side.keys() != self.loss.labels.keys():
            wanted, got = ", ".join(self.loss.labels), ", ".join(side)
            raise TypeError(f"the update of {self.name} takes observations of {wanted}; got {got}")
        return {kind: side[kind].reshape(-1, side[kind].shape[-1]) for kind in self.loss.labels}

    def _step(self, sides: Sequence[Mapping[str, Tensor]], weight: float) -> list[dict[str, Tensor]]:
        size, outs, losses = self.settings.minibatch, [], []
        for sets in sides:
            draws = {f"{kind}_observation": rows[self._draw(len(rows))] for kind, rows in sets.items()}
            if self.settings.penalty == "one_between":
                draws["between"] = torch.rand((size, 1), generator=self.generator, device=self.device)
            out = self.loss(TensorDict(draws, [size]))
            losses.append(torch.stack([value for key, value in out.items() if key.startswith("loss_")]).sum())
            outs.append(dict(out.items()))
        self.optimizer.zero_grad()
        two_sided_loss(losses, weight).backward()
        self.optimizer.step()
        return outs

    def _draw(self, rows: int) -> Tensor:
        """Indices of the next minibatch, drawn from `rows` rows."""
        size = (self.settings.minibatch,)
        return torch.randint(rows, size, generator=self.generator, device=self.device)
