"""Signals beyond the paper's that say where a skill should end, as pure functions of tensors.

Every function keeps the shape of its arguments (they broadcast) unless it says that it returns a scalar. F is an
outcome classifier (`feasibility`), P a proximity (`proximity_reward`), V the next skill's value, A its critic's error.
"""

from collections.abc import Sequence

import torch
from torch import Tensor
from torch.nn.functional import binary_cross_entropy_with_logits


def feasibility(logit: Tensor) -> Tensor:
    """F, how likely the next skill is to succeed from a state (or the share of the rest of the chain): 1 / (1 + e^-x).

    Args:
        logit: raw output of the outcome classifier for a state that the next skill is handed.

    Returns:
        Same shape, in (0, 1).

    Source: ours, near the feasibility function of Chen et al. 2023 (Sequential Dexterity).
    """
    return logit.sigmoid()


def outcome_loss(logit: Tensor, outcome: Tensor) -> Tensor:
    """The mean binary cross-entropy of F, -y ln F - (1 - y) ln(1 - F); it is least where F is the mean of y.

    Args:
        logit: raw outputs, any shape.
        outcome: same shape, in [0, 1]: what came of each state.

    Returns:
        A scalar.

    Source: as `feasibility`.
    """
    return binary_cross_entropy_with_logits(logit, outcome)


def remaining_share(succeeded: Tensor, later: Tensor, remaining: int) -> Tensor:
    """The share of the rest of a chain that is completed from a state: y (1 + (R - 1) l) / R.

    Args:
        succeeded: y, 1 where the skill that began in the state succeeded, 0 elsewhere.
        later: l, same shape, in [0, 1]: the share of what comes after that skill; counts only where it succeeded.
        remaining: R, skills from that one to the last.

    Returns:
        Same shape, in [0, 1].

    Source: ours; the skills after are looked ahead to, as a value function looks ahead to the next state.
    """
    return succeeded * (1.0 + (remaining - 1) * later) / remaining


def start_weights(expected: Tensor, share: float) -> Tensor:
    """How likely each of n starts is to be drawn: (1 - s) / n + s (1 - F) / sum(1 - F), s the share drawn by failure.

    Args:
        expected: F of the skill that begins there, (n,), in [0, 1].
        share: s, in [0, 1]; 0: all starts alike.

    Returns:
        (n,), with the sum 1. Where no failure is expected anywhere, all starts are alike.

    Source: ours.
    """
    alike = torch.full_like(expected, 1 / len(expected))
    failing = 1.0 - expected
    return alike if not failing.any() else (1.0 - share) * alike + share * failing / failing.sum()


def temporal_difference(
    reward: Tensor, value: Tensor, next_value: Tensor, terminated: Tensor, gamma: float
) -> Tensor:
    """The error A = r + gamma V(s') - V(s) of a critic in one step; what follows a terminated episode is worth 0.

    Args:
        reward: r, value: V(s), next_value: V(s'), of one shape and in one unit; terminated: bool, same shape.
        gamma: discount of one step.

    Returns:
        Same shape.

    Source: Sutton 1988.
    """
    return reward + gamma * next_value * ~terminated - value


def hand_over_value(value: Tensor, squared_error: Tensor, alpha: float) -> Tensor:
    """The next skill's value of a state, counted only as far as its critic is sure: (1 - min(alpha A^2, 1)) V.

    Args:
        value: V in units in which 1 is a good state; clipped to [0, 1].
        squared_error: A^2, same shape and units, the critic's squared temporal difference error there; a prediction of
            it may be negative and then counts as 0.
        alpha: how fast trust falls with the error: none is left where A^2 is 1 / alpha.

    Returns:
        Same shape, in [0, 1].

    Source: Tidd et al. 2021 (setup policies), the reward of a setup policy; we know it from a summary.
    """
    return (1.0 - (alpha * squared_error).clamp(0.0, 1.0)) * value.clamp(0.0, 1.0)


def proximity_target(steps_left: Tensor, handed_over: Tensor, decay: float) -> Tensor:
    """What P should say of a state: decay^k if a good hand-over follows after k steps, 0 if none does.

    Args:
        steps_left: k, steps from the state to the end of its episode, 0 in the last state.
        handed_over: bool, same shape; the episode ended in a success from which the next skill succeeded.
        decay: of one step, in (0, 1].

    Returns:
        Same shape, in [0, 1].

    Source: Lee et al. 2019 (transition policies), proximity predictor.
    """
    return torch.where(
        handed_over, decay ** steps_left.float(), torch.zeros_like(steps_left, dtype=torch.float32)
    )


def squared_error_loss(output: Tensor, target: Tensor) -> Tensor:
    """The mean squared distance of outputs from their targets, of one shape; a scalar."""
    return (output - target).square().mean()


def proximity_reward(p: Tensor, next_p: Tensor, ended: Tensor) -> Tensor:
    """The way that a step made towards a good hand-over, P(s') - P(s), plus P(s') where the skill ends in success.

    Args:
        p: raw output for s, next_p: for s'; both are clipped to [0, 1].
        ended: bool, same shape; s' ends a success of this skill.

    Returns:
        Same shape, in [-1, 2]. Over an episode that ends in success the sum is 2 P(s_T) - P(s_0).

    Source: Lee et al. 2019, reward of a transition policy.
    """
    p, next_p = p.clamp(0.0, 1.0), next_p.clamp(0.0, 1.0)
    return next_p - p + torch.where(ended, next_p, torch.zeros_like(next_p))


def two_sided_loss(sides: Sequence[Tensor], weight: float = 0.5) -> Tensor:
    """The losses of a discriminator at both sides of a skill, each with the same weight, summed.

    With each side E_I (D - 1)^2 + E_beta D^2 + 10 GP this is .5 (E_{I_i} (D - 1)^2 + E_{beta_{i-1}} D^2) +
    .5 (E_{I_{i+1}} (D - 1)^2 + E_{beta_i} D^2) + 10 GP, with GP the mean of the two sides' penalties.

    Args:
        sides: scalars; one of the first and of the last skill, which have one side.
        weight: of each.

    Returns:
        A scalar.

    Source: ours, after what is known of SCaR (Chen et al. 2024): "SCaR-like", since its text was not at hand.
    """
    return weight * torch.stack(list(sides)).sum()
