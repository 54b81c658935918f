"""Trials: deterministic episodes of the whole chain, and what they tell of every skill in it."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.envs import ExplorationType, TransformedEnv, set_exploration_type

from tstar_rl.chaining.chain import ChainPolicy
from tstar_rl.chaining.skill import Skill
from tstar_rl.rollouts.episodes import run_episodes

__all__ = ["SkillTrial", "Trial", "run_trial"]


@dataclass(frozen=True)
class SkillTrial:
    """What a trial tells of one skill, which began in n episodes.

    Attributes:
        starts: (n, O), the observations in which it began: its own starts, or where the skill before ended.
        succeeded: (n,) bool.
        ends: batch [number of successes], "observation" and "snapshot" of the states in which it succeeded.
    """

    starts: Tensor
    succeeded: Tensor
    ends: TensorDictBase

    @property
    def success(self) -> float:
        """The share of its episodes in which it succeeded; NaN if it never began."""
        return float(self.succeeded.double().mean())


@dataclass(frozen=True)
class Trial:
    """One deterministic episode of a chain in each of N simulations.

    Attributes:
        completed: (N,) int64, how many subtasks were done.
        skills: what it tells of each skill, in order.
        steps: environment steps it took.
    """

    completed: Tensor
    skills: list[SkillTrial]
    steps: int

    @property
    def progress(self) -> float:
        """The mean share of the chain's subtasks that were done."""
        return float(self.completed.double().mean()) / len(self.skills)


def run_trial(skills: Sequence[Skill], env: TransformedEnv) -> Trial:
    """Runs a chain once in every simulation of `env`, with the policies' mean actions; closes `env`.

    Args:
        skills: the chain; an episode ends once its last skill has succeeded.
        env: of the whole task, with `snapshot()`.
    """
    n, number = env.batch_size.numel(), len(skills)
    before = torch.zeros(n, dtype=torch.int64, device=env.device)
    starts: list[list[Tensor]] = [[] for _ in range(number)]
    rows: list[list[Tensor]] = [
        [] for _ in range(number)
    ]  # of the simulations that began skill k, in that order
    ends: list[list[TensorDictBase]] = [[] for _ in range(number)]
    nothing_yet = True

    def note(step: TensorDictBase) -> None:
        nonlocal nothing_yet
        if nothing_yet:
            nothing_yet = False
            starts[0].append(step["observation"].clone())
            rows[0].append(torch.arange(n, device=env.device))
        now = step["next", "completed"].squeeze(-1).clamp(max=number)
        made = (now > before).nonzero().squeeze(-1)
        if not len(made):
            return
        snapshot = env.base_env.snapshot()
        for k in before[made].unique().tolist():
            chosen = made[before[made] == k]
            reached = step["next", "observation"][chosen].clone()
            ends[k].append(
                TensorDict({"observation": reached, "snapshot": snapshot[chosen].clone()}, [len(chosen)])
            )
            if k + 1 < number:
                starts[k + 1].append(reached)
                rows[k + 1].append(chosen)
        before.copy_(torch.maximum(before, now))

    with set_exploration_type(ExplorationType.DETERMINISTIC):
        last = run_episodes(env, ChainPolicy(skills), note, enough=number)
    completed = before.clone()
    trials = []
    for k in range(number):
        began = torch.cat(rows[k]) if rows[k] else before[:0]
        seen = torch.cat(starts[k]) if starts[k] else starts[0][0][:0]
        reached = torch.cat(ends[k]) if ends[k] else TensorDict(batch_size=[0])
        trials.append(SkillTrial(seen, completed[began] > k, reached))  # pyright: ignore[reportArgumentType]
    env.close()
    return Trial(completed, trials, int(last["next", "step_count"].sum()))
