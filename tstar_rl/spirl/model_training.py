"""SPiRL's first stage: the latent model is fitted to windows of the demonstrations."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.objectives import LossModule

from tstar_rl.checks import InvalidValueError, check_ranges
from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.equations import latent_prior_loss, latent_reconstruction_loss, latent_regularisation_loss
from tstar_rl.spirl.model import LatentModel
from tstar_rl.updates.minibatches import nearly_equal

__all__ = ["LatentModelLoss", "ModelTrainingSettings", "split_windows", "train_latent_model", "windows"]


@dataclass(frozen=True)
class ModelTrainingSettings:
    """Source: SPiRL's appendix and the code released with it for the defaults."""

    beta: float = 5e-5
    """Weight of the posterior's divergence from a unit Gaussian, summed over z. The released code's 5e-4 is of its mean
    over ten dimensions."""
    epochs: int = 200
    minibatch: int = 128
    learning_rate: float = 1e-3
    cosine_decay: bool = False
    held_out: float = 0.1
    """Share of the episodes, the last ones and at least one, that measure the error and are not trained on."""
    pad: bool = False
    """Whether a window may reach past the end of its episode; it then repeats the last step. Windows then also begin
    less than H steps before a success."""
    log_every: int = 10
    """Epochs."""

    def __post_init__(self) -> None:
        check_ranges(
            self,
            count=("epochs", "minibatch", "log_every"),
            positive=("learning_rate",),
            not_negative=("beta",),
            share=("held_out",),
        )


class LatentModelLoss(LossModule):
    """The loss of a beta variational autoencoder of action windows, plus the loss of the prior.

    The prior is trained towards the posterior; no gradient of its loss reaches the posterior. The loss is the sum of
    the entries whose names begin with "loss_".

    Args:
        model: trained through this module's parameters.
        beta: weight of the posterior's divergence from a unit Gaussian.

    Raises:
        ValueError: if `beta` is negative.

    Source: SPiRL, eq. 1 and section 3.2.
    """

    in_keys: ClassVar[list[str]] = ["action", "observation"]  # pyright: ignore[reportIncompatibleMethodOverride]
    out_keys: ClassVar[list[str]] = [  # pyright: ignore[reportIncompatibleMethodOverride]
        "loss_reconstruction",
        "loss_regularisation",
        "loss_prior",
    ]

    def __init__(self, model: LatentModel, beta: float = 5e-5) -> None:
        super().__init__()
        if beta < 0:
            raise ValueError(f"beta must not be negative, got {beta}")
        self.model = model
        self.beta = beta

    def _forward_value_estimator_keys(self, **kwargs) -> None:
        pass

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """tensordict: windows, batch [B], of actions (B, H, 9) and observations (B, H, O) -> three losses, scalars."""
        actions, observations = (tensordict[key] for key in self.in_keys)
        loc, scale = self.model.posterior(actions)
        prior = self.model.prior(observations[:, 0])
        latent = loc + scale * torch.randn_like(scale)
        decoded = self.model.decoder.decode(latent, observations)
        losses = {
            "loss_reconstruction": latent_reconstruction_loss(decoded, actions),
            "loss_regularisation": latent_regularisation_loss(loc, scale, self.beta),
            "loss_prior": latent_prior_loss(loc, scale, *prior),
        }
        return TensorDict(losses)


def windows(
    observations: Tensor, actions: Tensor, lengths: Tensor, horizon: int, pad: bool
) -> TensorDictBase:
    """Every window of `horizon` steps inside an episode.

    Args:
        observations: (S, O), of episodes laid end to end.
        actions: (S, 9), of the same steps.
        lengths: (E,), of the episodes; their sum is S.
        horizon: H.
        pad: whether a window may reach past the end of its episode; it then repeats the last step.

    Returns:
        {"observation": (W, H, O), "action": (W, H, 9)}, batch [W].

    Raises:
        ValueError: if no episode is long enough.
    """
    rows = []
    for length, end in zip(lengths.tolist(), lengths.cumsum(0).tolist(), strict=True):
        starts = torch.arange(length if pad else max(length - horizon + 1, 0))
        steps = (starts.unsqueeze(-1) + torch.arange(horizon)).clamp(max=length - 1)
        rows.append(end - length + steps)
    index = torch.cat(rows)
    if not len(index):
        longest = f"the longest has {int(lengths.max())}"
        raise InvalidValueError(f"no episode has the {horizon} steps of spirl.model.horizon; {longest}")
    return TensorDict({"observation": observations[index], "action": actions[index]}, [len(index)])


def split_windows(
    expert: Demonstrations, horizon: int, settings: ModelTrainingSettings
) -> tuple[TensorDictBase, TensorDictBase]:
    """Windows of the first episodes, to train on, and windows of the last episodes, to measure the error on.

    Raises:
        ValueError: if no episode is left to train on, or no episode of either part is long enough.
    """
    kept = len(expert) - max(round(settings.held_out * len(expert)), 1)
    if kept < 1:
        raise InvalidValueError(
            f"spirl.model_training.held_out={settings.held_out} of {len(expert)} episodes leaves none to train on"
        )
    end = int(expert.lengths[:kept].sum())
    parts = ((slice(end), slice(kept)), (slice(end, None), slice(kept, None)))
    training, held_out = (
        windows(expert.observations[rows], expert.actions[rows], expert.lengths[part], horizon, settings.pad)
        for rows, part in parts
    )
    return training, held_out


def train_latent_model(
    model: LatentModel,
    training: TensorDictBase,
    held_out: TensorDictBase,
    settings: ModelTrainingSettings,
    seed: int = 0,
) -> Iterator[dict[str, float]]:
    """Trains the model in place and yields a row for the log every `log_every` epochs.

    Args:
        model: posterior, decoder and prior.
        training: from `windows`.
        held_out: from `windows`, of other episodes.
        settings: see `ModelTrainingSettings`.
        seed: of the order of the minibatches.

    Yields:
        The epoch, its mean losses, and the errors on the held-out windows.
    """
    generator = torch.Generator().manual_seed(seed)
    loss = LatentModelLoss(model, settings.beta)
    optimizer = torch.optim.Adam(loss.parameters(), settings.learning_rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, settings.epochs)
    for epoch in range(1, settings.epochs + 1):
        sums: dict[str, Tensor] = {}
        order = torch.randperm(len(training), generator=generator)
        for rows in nearly_equal(order, settings.minibatch):
            out = loss(training[rows])
            optimizer.zero_grad()
            torch.stack([value for key, value in out.items() if key.startswith("loss_")]).sum().backward()
            optimizer.step()
            for key, value in out.items():
                sums[key] = sums.get(key, 0.0) + value.detach() * len(rows) / len(training)
        if settings.cosine_decay:
            schedule.step()
        if epoch % settings.log_every == 0 or epoch == settings.epochs:
            row = {"epoch": epoch, **{f"model_{key}": float(value) for key, value in sums.items()}}
            yield row | model.errors(held_out)
