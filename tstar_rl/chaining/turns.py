"""The turns of skill chaining: each trains one skill of a chain, while the others stand still.

for turn in chain_turns(...):
    ...
    for rollout in turn.rollouts():
        ...
        turn.log(rollout, log)
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import torch
from tensordict import TensorDictBase
from torchrl.envs import TransformedEnv

from tstar_rl.chaining.chain import save_chain
from tstar_rl.chaining.gate import Gate, GateSettings
from tstar_rl.chaining.skill import Skill
from tstar_rl.chaining.training import Training, TrainingSettings
from tstar_rl.chaining.trials import chain_progress, seed_sets
from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.env.layout import NUM_PHASES, PARTS
from tstar_rl.rollouts.collection import Collection
from tstar_rl.rollouts.ray_collection import RayCollection
from tstar_rl.rollouts.state_sets import TerminationSet
from tstar_rl.runs.run import Run

__all__ = ["ChainSettings", "Turn", "Workshop", "chain_turns"]


@dataclass(frozen=True)
class ChainSettings:
    """How long a chain is fine-tuned, and what is noted of it."""

    rounds: int
    """Times that every skill has its turn."""
    rollouts: int
    """In one turn."""
    frames: int
    """Environment steps in one rollout."""
    logged_skill: int
    """Whose terminal states are logged, for the paper's Figure 4."""
    logged_states: int
    """How many of a rollout."""


class Workshop(Protocol):
    """What makes a chain's environments."""

    def turn_seed(self, turn: int) -> int:
        """Of all that is random in a turn."""
        ...

    def collection(
        self, skill: Skill, seed: int, before: TerminationSet | None
    ) -> Collection | RayCollection:
        """Rollouts of a skill; `before` is the termination set of the skill before, if there is one."""
        ...

    def skill_trial(self, skills: Sequence[Skill], trial: int, index: int) -> TransformedEnv:
        """Where skill `index` is tried, from where the one before ends; a trial has seeds of its own."""
        ...

    def chain_trial(self) -> TransformedEnv:
        """Where the whole chain is tried, always from the same starts."""
        ...


class Turn(Training):
    """The training of one skill of the chain for some rollouts.

    Attributes:
        skill: trained in this turn.
        following: the next skill; None after the last.
        index: of the skill, 0-based.
    """

    def __init__(
        self,
        chain: "_Chain",
        index: int,
        seed: int,
        collection: Collection | RayCollection,
    ) -> None:
        skills = chain.skills
        super().__init__(skills[index], chain.experts[index], chain.run, chain.training, collection, seed)
        self.chain, self.index = chain, index
        self.following = skills[index + 1] if index + 1 < len(skills) else None
        self._before = self.skill.network_state()

    def rollouts(self) -> Iterator[TensorDictBase]:
        """The turn's rollouts (N, T); after the last one the gate judges the skill."""
        run, settings = self.run, self.chain.settings
        for number in range(settings.rollouts):
            rollout = self._collect(1.0)
            self._log_terminal_states(rollout)
            yield rollout
            row = self._finish_rollout(rollout)
            if number == settings.rollouts - 1:
                make_trial = partial(
                    self.chain.workshop.skill_trial, self.chain.skills, run.turn + 1, self.index
                )
                row |= self.chain.gate.judge(self.skill, self._before, make_trial, run.turn).row()
            round_ = run.turn // len(self.chain.skills)
            run.log(self.steps, skill=self.index, round=round_, **row)
            if run.improved:
                self.chain.save("best", self.steps)
        self.collection.close()

    def _log_terminal_states(self, rollout: TensorDictBase) -> None:
        settings = self.chain.settings
        if self.index == settings.logged_skill:
            reached = rollout["next", "observation"][rollout["next", "success"].squeeze(-1)]
            poses = reached[: settings.logged_states, PARTS:-NUM_PHASES]  # of all parts, (n, 7 P)
            self.run.log_terminal_states(self.steps, self.index, poses)


@dataclass
class _Chain:
    """What all turns of a run share."""

    skills: Sequence[Skill]
    experts: Sequence[Demonstrations]
    run: Run
    settings: ChainSettings
    training: TrainingSettings
    workshop: Workshop
    gate: Gate
    save: Callable[[str, int], None]


def chain_turns(
    skills: Sequence[Skill],
    experts: Sequence[Demonstrations],
    run: Run,
    settings: ChainSettings,
    training: TrainingSettings,
    gate: GateSettings,
    workshop: Workshop,
    **record: Any,
) -> Iterator[Turn]:
    """Algorithm 1's second loop: turns of the skills in order, `rounds` times; goes on from a checkpoint.

    Args:
        skills: the chain, fine-tuned in place.
        experts: demonstrations of each subtask.
        run: log and checkpoints. A checkpoint is written after every turn.
        settings: see `ChainSettings`.
        training: see `TrainingSettings`.
        gate: see `GateSettings`.
        workshop: makes the environments.
        **record: plain values that are saved with the best and the last chain.
    """

    def save(name: str, steps: int) -> None:
        save_chain(skills, run.work / name, **record, env_steps=steps)

    judge = Gate(gate, lambda: chain_progress(skills, workshop.chain_trial()))
    chain = _Chain(skills, experts, run, settings, training, workshop, judge, save)
    run.start(**{f"skill{index}": skill for index, skill in enumerate(skills)})
    if run.turn == 0:
        seed_sets(skills, partial(workshop.skill_trial, skills, 0))
    while run.turn < settings.rounds * len(skills):
        index, seed = run.turn % len(skills), workshop.turn_seed(run.turn)
        torch.manual_seed(seed)
        before = skills[index - 1].termination_set if index else None
        yield Turn(chain, index, seed, workshop.collection(skills[index], seed, before))
        run.turn += 1
        run.save_if_due(0)
    save("last", run.env_steps)
    run.finish()
