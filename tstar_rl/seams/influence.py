"""Whether a skill can move what the next one makes of its terminal state.

From each of some states the skill is run several times with sampled actions, and the next skill, whose actions are
deterministic, from wherever it ended. Where the next skill's outcome differs between runs from one and the same state,
what the skill did in between has decided it. Where it does not, the start had decided it already, and no reward on the
terminal state could mend it.
"""

from collections.abc import Callable
from typing import NamedTuple

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.envs import ExplorationType, TransformedEnv, set_exploration_type

from tstar_rl.rollouts.episodes import run_episodes
from tstar_rl.rollouts.state_sets import TerminationSet

__all__ = ["Influence", "Repeated", "influence_of", "share_within"]


class Influence(NamedTuple):
    """What a skill's own actions decide at the seam behind it."""

    starts: int
    """States from which it succeeded at least twice."""
    succeeded: float
    """Share of the terminal states behind these starts from which the next skill succeeds."""
    within: float
    """Share of the outcome's variance between runs from one start: 1, the skill decides it all; 0, nothing. Or nan."""


class Repeated(TerminationSet):
    """Starts handed out in their order, each `times` over, whatever the generator says.

    Args:
        rows: a batch of states with "snapshot", (n,).
        times: how often each is handed out, one after the other.
    """

    def __init__(self, rows: TensorDictBase, times: int = 1) -> None:
        super().__init__(max(rows.batch_size[0], 1))
        self.extend(rows)
        self.times = times

    def sample(self, n: int, generator: torch.Generator) -> TensorDictBase:
        """The first n of them, batch size [n]; they begin anew after the last."""
        order = torch.arange(n).div(self.times, rounding_mode="floor") % max(len(self), 1)
        return self.buffer[order]


def influence_of(
    make_env: Callable[[int, int, TerminationSet | None], TransformedEnv],
    policies: tuple[Callable, Callable],
    subtask: int,
    starts: TensorDictBase,
    times: int = 8,
) -> Influence | None:
    """Runs a skill `times` over from each start, and the next skill once from each of its ends.

    Args:
        make_env: of a subtask, a number of simulations, and the set that all of them begin in.
        policies: of the skill and of the next one.
        subtask: of the skill.
        starts: states with "snapshot" in which its subtask begins, (n,).
        times: runs from each start.

    Returns:
        None where no state has two successes of the skill.
    """
    number = starts.batch_size[0] * times
    env = make_env(subtask, number, Repeated(starts, times))
    with set_exploration_type(ExplorationType.RANDOM):
        last = run_episodes(env, policies[0])
    env.close()
    of_start = torch.arange(number).div(times, rounding_mode="floor")
    won = last["next", "success"].squeeze(-1).cpu()
    if not won.any():
        return None
    ends = last.get("next")[won.to(last.device)].select("observation", "snapshot")
    env = make_env(subtask + 1, int(won.sum()), Repeated(ends))
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        after = run_episodes(env, policies[1])
    env.close()
    return share_within(of_start[won], after["next", "success"].squeeze(-1).cpu())


def share_within(groups: Tensor, outcomes: Tensor) -> Influence | None:
    """Splits the variance of outcomes into what lies within groups and between them.

    The variance within is estimated without bias from each group of two or more; groups count by their size. `within`
    is nan where there is nothing to split: with one such group, or with outcomes that are all the same.

    Args:
        groups: (n,) int64, which start each run is from.
        outcomes: (n,) bool.

    Returns:
        None where no group has two runs.

    Source: Searle, Casella and McCulloch, Variance Components, 1992, section 3.6 (one-way classification).
    """
    values, numbers = outcomes.double(), torch.bincount(groups)
    kept = (numbers >= 2)[groups]
    if not kept.any():
        return None
    values, groups = values[kept], groups[kept]
    numbers = torch.bincount(groups, minlength=len(numbers))
    sums = torch.bincount(groups, weights=values, minlength=len(numbers))
    there = numbers > 0
    numbers, sums = numbers[there].double(), sums[there]
    means, total = sums / numbers, numbers.sum()
    inside = numbers * means * (1 - means)  # sum of squares in each group: outcomes are 0 or 1
    starts = len(numbers)
    within = float(inside.sum() / (total - starts))
    if starts < 2:
        return Influence(starts, float(values.mean()), float("nan"))
    square = float((numbers * (means - values.mean()).square()).sum()) / (starts - 1)
    size = float(total - numbers.square().sum() / total) / (starts - 1)
    between = max((square - within) / size, 0.0)
    whole = within + between
    return Influence(starts, float(values.mean()), within / whole if whole > 0 else float("nan"))
