"""Trials: deterministic episodes of the whole chain, and what they tell of every skill in it."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.envs import ExplorationType, TransformedEnv, set_exploration_type

from tstar_rl.chaining.chain import ChainPolicy
from tstar_rl.chaining.paths import Path, PathLog
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
        simulations: (n,) int64, in which simulation each start was.
        path: the last states of its episodes; none where a trial keeps no paths.
    """

    starts: Tensor
    succeeded: Tensor
    ends: TensorDictBase
    simulations: Tensor
    path: Path

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

    def share_from(self, skill: int) -> Tensor:
        """For each start of a skill, (n,) in [0, 1]: of the skills from it to the last, the share that was done."""
        done = self.completed[self.skills[skill].simulations] - skill
        return done.double() / (len(self.skills) - skill)

    def handed_over(self, skill: int) -> Tensor:
        """For each state of a skill's path, (m,) bool: whether its episode ended where the next skill succeeds."""
        return self.completed[self.skills[skill].path.simulation] > skill + 1


class _Notes:
    """What is noted at every step of a trial."""

    def __init__(self, env: TransformedEnv, number: int, path_steps: int) -> None:
        self.env, self.number = env, number
        n, device = env.batch_size.numel(), env.device
        self.completed = torch.zeros(n, dtype=torch.int64, device=device)
        self.running = torch.ones(n, dtype=torch.bool, device=device)
        self.starts: list[list[Tensor]] = [[] for _ in range(number)]
        self.rows: list[list[Tensor]] = [[] for _ in range(number)]
        """Of the simulations that began skill k, in that order."""
        self.ends: list[list[TensorDictBase]] = [[] for _ in range(number)]
        self.paths = PathLog(n, number, path_steps)

    def __call__(self, step: TensorDictBase) -> None:
        before, number = self.completed, self.number
        reached: Tensor = step["next", "observation"]
        if not self.starts[0]:
            self._begin(0, torch.arange(len(before), device=before.device), step["observation"])
        self.paths.add(reached, self.running)
        self.running &= ~step["next", "done"].squeeze(-1)
        now = step["next", "completed"].squeeze(-1).clamp(max=number)
        made = (now > before).nonzero().squeeze(-1)
        if not len(made):
            return
        snapshot = self.env.base_env.snapshot()
        for k in before[made].unique().tolist():
            chosen = made[before[made] == k]
            end = {"observation": reached[chosen].clone(), "snapshot": snapshot[chosen].clone()}
            self.ends[k].append(TensorDict(end, [len(chosen)]))
            self.paths.end(k, chosen)
            if k + 1 < number:
                self._begin(k + 1, chosen, reached)
        before.copy_(torch.maximum(before, now))

    def _begin(self, skill: int, rows: Tensor, observation: Tensor) -> None:
        self.starts[skill].append(observation[rows].clone())
        self.rows[skill].append(rows)
        self.paths.begin(observation, rows)

    def of_skill(self, k: int) -> SkillTrial:
        """What was noted of skill k; to be called once, after the last step."""
        began = torch.cat(self.rows[k]) if self.rows[k] else self.completed[:0]
        starts = torch.cat(self.starts[k]) if self.starts[k] else self.starts[0][0][:0]
        ends = torch.cat(self.ends[k]) if self.ends[k] else TensorDict(batch_size=[0])
        succeeded = self.completed[began] > k
        self.paths.end(k, began[~succeeded])
        return SkillTrial(starts, succeeded, ends, began, self.paths.of_skill(k))  # pyright: ignore[reportArgumentType]


def run_trial(skills: Sequence[Skill], env: TransformedEnv, path_steps: int = 0) -> Trial:
    """Runs a chain once in every simulation of `env`, with the policies' mean actions; closes `env`.

    Args:
        skills: the chain; an episode ends once its last skill has succeeded.
        env: of the whole task, with `snapshot()`.
        path_steps: how many of the last states of each skill's episodes are kept.
    """
    notes = _Notes(env, len(skills), path_steps)
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        last = run_episodes(env, ChainPolicy(skills), notes, enough=len(skills))
    trials = [notes.of_skill(k) for k in range(len(skills))]
    env.close()
    return Trial(notes.completed, trials, int(last["next", "step_count"].sum()))
