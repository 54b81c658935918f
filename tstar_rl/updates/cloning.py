"""Behaviour cloning: the policy's mean fitted to demonstrated actions."""

from dataclasses import dataclass

import torch
from torch import Tensor
from torchrl.modules import ProbabilisticActor

from tstar_rl.checks import check_losses, check_ranges
from tstar_rl.models.networks import split_policy
from tstar_rl.updates.minibatches import nearly_equal


@dataclass(frozen=True)
class BehaviourCloningSettings:
    """Source: docs/task.md, "Training figures" (BC), for the defaults.

    Raises:
        InvalidValueError: for a number out of its range.
    """

    epochs: int = 1000
    """Times that the demonstrations are gone through."""
    minibatch: int = 256
    """Rows at most: an epoch is split into nearly equal parts."""
    learning_rate: float = 1e-4
    """Of Adam."""
    cosine_decay: bool = False
    """Whether the rate falls to nothing along half a cosine."""

    def __post_init__(self) -> None:
        check_ranges(self, count=("epochs", "minibatch"), positive=("learning_rate",))


def behaviour_cloning(
    policy: ProbabilisticActor,
    observations: Tensor,
    actions: Tensor,
    settings: BehaviourCloningSettings,
    seed: int = 0,
) -> dict[str, float]:
    """Fits the policy's mean to actions (n, 9) at observations (n, O) by least squares; logs the last epoch's loss.

    What the network's input is made of each observation has no parameters: it is computed once, not in each epoch.

    Raises:
        ValueError: there are not as many actions as observations, or they are of another size than the policy's.
        DivergedError: the loss is no finite number.
    """
    if len(observations) != len(actions):
        raise ValueError(
            f"each observation needs its action, got {len(observations)} observations and {len(actions)} actions"
        )
    device = observations.device
    encoder, body = split_policy(policy)
    with torch.no_grad():
        encoded = encoder.module(observations)
    generator = torch.Generator(device).manual_seed(seed)
    optimizer = torch.optim.Adam(policy.parameters(), settings.learning_rate)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, settings.epochs)
    loss_sum, count = torch.zeros((), dtype=torch.float64, device=device), 0
    for _ in range(settings.epochs):
        loss_sum, count = torch.zeros_like(loss_sum), 0
        order = torch.randperm(len(observations), generator=generator, device=device)
        for rows in nearly_equal(order, settings.minibatch):
            loc, _ = body.module(encoded[rows])
            if loc.shape[1:] != actions.shape[1:]:  # torch would broadcast
                raise ValueError(
                    f"actions must be (n, {loc.shape[-1]}), as the policy's are; got {tuple(actions.shape)}"
                )
            loss = (loc - actions[rows]).square().mean()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            loss_sum, count = loss_sum + loss.detach() * len(rows), count + len(rows)
        if settings.cosine_decay:
            schedule.step()
    log = {"bc_loss": float(loss_sum) / max(count, 1)}
    check_losses(log, f"after {settings.epochs} epochs of behaviour cloning")
    return log
