"""What signals of where a skill should end are made from, and how they are judged."""

import math
from collections.abc import Callable
from typing import Protocol

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor, nn

from tstar_rl.chaining.calibration import (
    Reliability,
    area_under_curve,
    brier_score,
    expected_calibration_error,
    reliability_curve,
)
from tstar_rl.chaining.skill import Skill
from tstar_rl.signal_equations import remaining_share, temporal_difference

__all__ = ["OnceLearned", "Signal", "StateValue", "critic_errors", "judge", "outcomes_of", "value_scale"]


class Signal(Protocol):
    """Says how good a state is to hand over, as a reward transform does."""

    def said(self, obs: Tensor) -> Tensor:
        """obs: (n, O) -> (n, 1)."""
        ...


class OnceLearned(nn.Module):
    """A network of scores that pays nothing for what it has not learned yet.

    Args:
        network: observations (..., O) -> (..., 1).
        has_learned: whether it has made a step on data.
    """

    def __init__(self, network: nn.Module, has_learned: Callable[[], bool]) -> None:
        super().__init__()
        self.network, self.has_learned = network, has_learned

    def forward(self, obs: Tensor) -> Tensor:
        """obs: (..., O) -> (..., 1); 0 until it has learned."""
        return self.network(obs) if self.has_learned() else torch.zeros_like(obs[..., :1])


class StateValue(nn.Module):
    """A skill's critic as a score: observation (..., O) -> value (..., 1), in the critic's own units."""

    def __init__(self, skill: Skill) -> None:
        super().__init__()
        self.value = skill.value

    def forward(self, obs: Tensor) -> Tensor:
        """obs: (..., O) -> (..., 1)."""
        return self.value(TensorDict({"observation": obs}, obs.shape[:-1]))["state_value"]


@torch.no_grad()
def value_scale(skill: Skill, fixed: float | None = None) -> float | None:
    """The value that counts as 1: `fixed`, or the critic's mean over the states from which the skill has succeeded.

    None while there are no such states, or where their mean is not positive: then the critic has no unit.
    """
    if fixed is not None:
        return fixed
    if not len(skill.initiation_set):
        return None
    mean = float(StateValue(skill)(skill.initiation_set.observations()).mean())
    return mean if mean > 0 else None


def outcomes_of(
    rollout: TensorDictBase, remaining: int, later: Callable[[Tensor], Tensor] | None
) -> tuple[Tensor, Tensor, Tensor]:
    """What came of the starts of a rollout's episodes that have ended, failed ones too.

    Args:
        rollout: any shape, with `EpisodeStart`'s entry.
        remaining: skills from the one that was rolled out to the chain's last.
        later: what is said of the states in which it succeeded, (n, O): the share of what comes after, (n, 1); None:
            nothing comes after.

    Returns:
        Observations (n, O), whether the skill succeeded (n,) bool, share of the rest of the chain (n,) in [0, 1].
    """
    ended = rollout.select("start_observation", ("next", "observation"), ("next", "success"))
    ended = ended[rollout["next", "done"].squeeze(-1)]
    succeeded = ended["next", "success"].squeeze(-1)
    share = torch.zeros(len(succeeded), device=succeeded.device)
    if later is not None and bool(succeeded.any()):
        with torch.no_grad():
            share[succeeded] = later(ended["next", "observation"][succeeded]).squeeze(-1).clamp(0.0, 1.0)
    return ended["start_observation"], succeeded, remaining_share(succeeded.float(), share, remaining)


@torch.no_grad()
def critic_errors(
    rollout: TensorDictBase, skill: Skill, gamma: float, reward_scale: float, scale: float
) -> tuple[Tensor, Tensor]:
    """The squared temporal difference error of a skill's critic in the first step of every episode of a rollout.

    To be asked before the critic is fitted to this rollout: of one that it has just learned from it says too little.

    Args:
        rollout: any shape, with ("next", "reward") and the step count.
        skill: that was rolled out.
        gamma: discount.
        reward_scale: deviation of returns, by which the critic's rewards were divided.
        scale: the value that counts as 1, in the critic's own units.

    Returns:
        The states in which the episodes began, (n, O); the squared errors in units of `scale`, (n,).
    """
    first = rollout[(rollout["next", "step_count"] == 1).squeeze(-1)]
    value = StateValue(skill)
    now, then = value(first["observation"]), value(first["next", "observation"])
    reward = first["next", "reward"] / reward_scale
    error = temporal_difference(reward, now, then, first["next", "terminated"], gamma) / scale
    return first["observation"], error.square().squeeze(-1)


@torch.no_grad()
def judge(
    name: str, signal: Signal, handed: Tensor, succeeded: Tensor, outcome: Tensor
) -> tuple[dict[str, float], Reliability | None]:
    """How well what a signal says of states tells what then happened.

    Args:
        name: prefix of the columns.
        signal: what is judged; its scores are clipped to [0, 1], as they are paid.
        handed: (n, O), the states.
        succeeded: (n,) bool, whether the next skill did: the AUC is against this.
        outcome: (n,) in [0, 1], what the signal is to say: the others are against this.

    Returns:
        Columns auc, sd (of the scores), brier, ece (see `calibration`), and the reliability curve; None of no states.
    """
    if not len(handed):
        return {f"{name}_{column}": math.nan for column in ("auc", "sd", "brier", "ece")}, None
    scores = signal.said(handed).squeeze(-1).clamp(0.0, 1.0)
    curve = reliability_curve(scores, outcome)
    found = {
        "auc": area_under_curve(scores, succeeded),
        "sd": float(scores.std()) if len(scores) > 1 else math.nan,
        "brier": brier_score(scores, outcome),
        "ece": expected_calibration_error(curve),
    }
    return {f"{name}_{column}": value for column, value in found.items()}, curve
