"""The skill model fitted to windows of demonstrations."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.spirl.skill_model import SkillModel
from tstar_rl.spirl.skill_model_loss import SkillModelLoss


@dataclass(frozen=True)
class SkillModelTraining:
    """Source: SPiRL's appendix and the code released with it for the defaults."""

    beta: float = 5e-4
    epochs: int = 200
    minibatch: int = 128
    learning_rate: float = 1e-3
    cosine_decay: bool = False
    held_out: float = 0.1
    """Share of the episodes, the last ones, that measures the error."""
    pad: bool = False
    """Whether windows also begin less than H steps before an episode ends, its last action repeated: else there is no
    skill for the states from which a success is near."""
    log_every: int = 10
    """Epochs."""


def windows(
    observations: Tensor, actions: Tensor, lengths: Tensor, horizon: int, pad: bool
) -> TensorDictBase:
    """Every window of `horizon` steps inside an episode.

    Args:
        observations: (S, O), actions: (S, 9), episodes laid end to end.
        lengths: (E,), of the episodes; S is their sum.
        horizon: H.
        pad: also windows that reach past the end of an episode: they repeat its last step.

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
        raise ValueError(f"no episode has {horizon} steps; the longest has {int(lengths.max())}")
    return TensorDict({"observation": observations[index], "action": actions[index]}, [len(index)])


def held_out_windows(
    expert: Demonstrations, horizon: int, settings: SkillModelTraining
) -> tuple[TensorDictBase, TensorDictBase]:
    """The windows of the first episodes, to train on, and of the last ones, to measure on."""
    kept = len(expert) - max(round(settings.held_out * len(expert)), 1)
    end = int(expert.lengths[:kept].sum())
    first, last = (
        windows(
            expert.observations[rows], expert.actions[rows], expert.lengths[episodes], horizon, settings.pad
        )
        for rows, episodes in (
            (slice(end), slice(kept)),
            (slice(end, None), slice(kept, None)),
        )
    )
    return first, last


def train_skill_model(
    model: SkillModel,
    training: TensorDictBase,
    held_out: TensorDictBase,
    settings: SkillModelTraining,
    seed: int = 0,
) -> Iterator[dict[str, float]]:
    """Trains, and yields a row for the log every few epochs: mean losses, and the errors on windows held out.

    Args:
        model: in place.
        training: from `windows`, held_out: of other episodes.
        settings: see `SkillModelTraining`.
        seed: of the order of minibatches.
    """
    generator = torch.Generator().manual_seed(seed)
    loss = SkillModelLoss(model, settings.beta)
    optimizer = torch.optim.Adam(loss.parameters(), settings.learning_rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, settings.epochs)
    for epoch in range(1, settings.epochs + 1):
        sums: dict[str, Tensor] = {}
        order = torch.randperm(len(training), generator=generator)
        for rows in order.split(settings.minibatch):
            out = loss(training[rows])
            optimizer.zero_grad()
            torch.stack([value for key, value in out.items() if key.startswith("loss_")]).sum().backward()
            optimizer.step()
            for key, value in out.items():
                sums[key] = sums.get(key, 0.0) + value.detach() * len(rows) / len(training)
        if settings.cosine_decay:
            schedule.step()
        if epoch % settings.log_every == 0 or epoch == settings.epochs:
            row = {"epoch": epoch, **{f"skill_{key}": float(value) for key, value in sums.items()}}
            yield row | held_out_errors(model, held_out)


@torch.no_grad()
def held_out_errors(model: SkillModel, held_out: TensorDictBase) -> dict[str, float]:
    """Mean squared errors of actions, on windows: decoded from the mean of the posterior, which has seen them, and of
    the prior, which has seen the first state; beside them the variance of the actions.
    """
    actions, observations = cast(Tensor, held_out["action"]), cast(Tensor, held_out["observation"])

    def error(skill: Tensor) -> float:
        return float((model.decoder.decode(skill, observations) - actions).square().mean())

    return {
        "held_out_error": error(model.posterior(actions)[0]),
        "held_out_prior_error": error(model.prior(observations[:, 0])[0]),
        "held_out_variance": float(actions.flatten(0, 1).var(0, unbiased=False).mean()),
    }
