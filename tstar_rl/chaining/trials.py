"""Trials: deterministic episodes of the whole chain, and what they tell of every skill in it.

A trial runs skill after skill, each from the states in which the one before it succeeded and the episode went on. So
what it tells of a skill hangs on that skill and those before it alone, and need not be found again while these stand
still.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.envs import ExplorationType, TransformedEnv, set_exploration_type

from tstar_rl.chaining.chain import check_order
from tstar_rl.chaining.paths import Path, PathLog
from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import InvalidValueError
from tstar_rl.rollouts.episodes import run_episodes
from tstar_rl.transforms import SkillChainReset

__all__ = ["SkillTrial", "Trial", "run_trial"]


@dataclass(frozen=True)
class SkillTrial:
    """What a trial tells of one skill, which began in n episodes. All are in the order of the simulations.

    Attributes:
        starts: (n, O), the observations in which it began: its own starts, or where the skill before ended.
        succeeded: (n,) bool.
        ends: batch [number of successes], "observation" and "snapshot" of the states in which it succeeded.
        over: (number of successes,) bool, whether the episode ended in that step, at its time limit or as the task was
            done: such a state is handed to nobody, though it is one in which the skill ends.
        simulations: (n,) int64, in which simulation each start was.
        path: the last states of its episodes; none where a trial keeps no paths.
        steps: environment steps of these episodes.
    """

    starts: Tensor
    succeeded: Tensor
    ends: TensorDictBase
    over: Tensor
    simulations: Tensor
    path: Path
    steps: int

    @property
    def handed_on(self) -> Tensor:
        """(m,) int64, the simulations in which the next skill takes over."""
        return self.simulations[self.succeeded][~self.over]

    @property
    def success(self) -> float:
        """The share of its episodes in which it succeeded; NaN if it never began."""
        return float(self.succeeded.double().mean())


@dataclass(frozen=True)
class Trial:
    """One deterministic episode of a chain in each of N simulations; what it tells of each skill, in order."""

    skills: list[SkillTrial]

    @property
    def completed(self) -> Tensor:
        """(N,) int64, how many subtasks were done."""
        done = torch.zeros_like(self.skills[0].simulations)
        for found in self.skills:
            done[found.simulations[found.succeeded]] += 1
        return done

    @property
    def progress(self) -> float:
        """The mean share of the chain's subtasks that were done."""
        return float(self.completed.double().mean()) / len(self.skills)

    def steps(self, first: int = 0) -> int:
        """Environment steps of the skills from `first` on."""
        return sum(found.steps for found in self.skills[first:])

    def share_from(self, skill: int) -> Tensor:
        """For each start of a skill, (n,) in [0, 1]: of the skills from it to the last, the share that was done."""
        done = self.completed[self.skills[skill].simulations] - skill
        return done.double() / (len(self.skills) - skill)

    def cost(self, skill: int) -> float:
        """The progress that the chain would gain if a skill never failed and those after it did as often as they do.

        In [0, 1]. A later skill that never began is taken to succeed: nothing is known against it.
        """
        onward, gained = 1.0, 1.0
        for found in self.skills[skill + 1 :]:
            onward *= found.success if len(found.starts) else 1.0
            gained += onward
        failures = int((~self.skills[skill].succeeded).sum())
        return failures * gained / (len(self.skills[0].starts) * len(self.skills))

    def handed_over(self, skill: int) -> Tensor:
        """For each state of a skill's path, (m,) bool: whether its episode ended where the next skill succeeds."""
        return self.completed[self.skills[skill].path.simulation] > skill + 1


class _Notes:
    """What is noted at every step of a skill's episodes."""

    def __init__(self, env: TransformedEnv, skill: int, rows: Tensor, path_steps: int) -> None:
        self.env, self.skill, self.rows = env, skill, rows
        self.starts: Tensor | None = None
        self.succeeded = torch.zeros_like(rows)
        self.ended: list[tuple[Tensor, TensorDictBase]] = []
        """Simulations that succeeded in a step, and their states then, with "over"."""
        self.running, self.path = rows.clone(), PathLog(len(rows), path_steps)

    def __call__(self, step: TensorDictBase) -> None:
        if self.starts is None:
            self.starts = step["observation"][self.rows].clone()
            self.path.add(step["observation"], self.running)
        reached: Tensor = step["next", "observation"]
        self.path.add(reached, self.running)
        done = step["next", "done"].squeeze(-1)
        made = self.running & (step["next", "subtask"].squeeze(-1) > self.skill)
        self.running &= ~(made | done)
        if bool(made.any()):
            end = {
                "observation": reached[made],  # rows drawn by a mask are a copy
                "snapshot": self.env.base_env.snapshot()[made],
                "over": done[made],
            }
            simulations = made.nonzero().squeeze(-1)
            self.ended.append((simulations, TensorDict(end, [len(simulations)])))
            self.succeeded |= made

    def of_skill(self, steps: int) -> SkillTrial:
        """What was noted, after the last step."""
        assert self.starts is not None
        simulations = self.rows.nonzero().squeeze(-1)
        ends: TensorDictBase = TensorDict({"over": torch.zeros_like(self.rows[:0])}, [0])
        if self.ended:
            order = torch.cat([at for at, _ in self.ended]).argsort()
            ends = torch.cat([states for _, states in self.ended])[order]  # pyright: ignore
        succeeded, path = self.succeeded[simulations], self.path.of(simulations)
        return SkillTrial(
            self.starts, succeeded, ends.exclude("over"), ends["over"], simulations, path, steps
        )


def _check_handed_over(found: Sequence[SkillTrial]) -> None:
    """Raises InvalidValueError where the last skill began no nearer to where the one before ended than resets are.

    That is if no number of its observations is: one that is noisy, or new at a reset as a last action, tells nothing.
    """
    if len(found) < 2 or not len(found[-1].starts):
        return
    before, began, resets = found[-2], found[-1].starts, found[0].starts[found[-1].simulations]
    ended = before.ends["observation"][~before.over]
    off, of_resets = ((states - ended).abs().mean(0) for states in (began, resets))
    differs = of_resets > 1e-6
    if bool(differs.any()) and bool((off > of_resets / 2)[differs].all()):
        raise InvalidValueError(
            f"skill {len(found) - 1} did not begin where skill {len(found) - 2} ended: at a reset the environment must "
            'begin in ("start", "snapshot") where ("start", "use"); see docs/library.md'
        )


class _HandedOver:
    """Starts where the skill before ended, one for each simulation; none at first."""

    def __init__(self) -> None:
        self.snapshots: TensorDictBase = TensorDict(batch_size=[0])

    def hand(self, snapshots: TensorDictBase, rows: Tensor) -> None:
        """Snapshots in the order of simulations `rows`, (N,) bool; the others get a copy of one, and are not run."""
        self.snapshots = snapshots[(rows.cumsum(0) - 1).clamp_min(0)]

    def sample(self, n: int, generator: torch.Generator) -> TensorDictBase:
        """All of them, batch size [n]; [0] at first."""
        return self.snapshots


def run_trial(
    skills: Sequence[Skill],
    env: TransformedEnv,
    path_steps: int = 0,
    known: Trial | None = None,
    first: int = 0,
) -> Trial:
    """Runs a chain once in every simulation of `env`, with the policies' mean actions; closes `env`.

    Args:
        skills: the chain; an episode ends once its last skill has succeeded.
        env: of the whole task, with `snapshot()`, and with a `StepCounter` as `with_starts` makes it.
        path_steps: how many of the last states of each skill's episodes are kept.
        known: a trial from the same starts. What it tells of the skills before `first`, which have not changed since,
            is taken from it; the result is the same, to the bit, as without it.
        first: the first skill that has changed; of no meaning without `known`.

    Raises:
        InvalidValueError: if the skills are no chain (`check_order`), if the environment counts no steps, or if it does
            not begin an episode in the state that `SkillChainReset` hands to it.
    """
    check_order(skills)
    if "step_count" not in env.observation_spec.keys():
        raise InvalidValueError("a trial needs an environment with a StepCounter: with_starts(env) adds it")
    found = [] if known is None else known.skills[:first]
    handed = _HandedOver()
    env.append_transform(SkillChainReset(handed, probability=1.0, goes_on=True))
    try:
        with set_exploration_type(ExplorationType.DETERMINISTIC):
            for index in range(len(found), len(skills)):
                before = found[-1] if found else None
                found.append(_run_skill(index, skills[index].policy, env, handed, before, path_steps))
                _check_handed_over(found)
    finally:
        env.close()
    return Trial(found)


def _run_skill(
    index: int,
    policy: Callable,
    env: TransformedEnv,
    handed: _HandedOver,
    before: SkillTrial | None,
    path_steps: int,
) -> SkillTrial:
    """One skill, from the environment's own starts or from where the skill before handed over."""
    rows = torch.ones(env.batch_size, dtype=torch.bool, device=env.device)
    if before is not None:
        made = before.handed_on
        if not len(made):
            nobody, none = PathLog(len(rows), path_steps).of(made), before.succeeded[:0]
            return SkillTrial(before.starts[:0], none, before.ends[:0], none, made, nobody, 0)
        rows = torch.zeros_like(rows).index_fill(0, made, True)
        handed.hand(before.ends["snapshot"][~before.over], rows)
    notes = _Notes(env, index, rows, path_steps)
    last = run_episodes(env, policy, notes, enough=index + 1, rows=rows)
    steps: Tensor = last["next", "step_count"]
    return notes.of_skill(int(steps[rows].sum()))
