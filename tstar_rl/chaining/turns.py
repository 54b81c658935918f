"""The turns of skill chaining: each trains one skill of a chain, while the others stand still.

for turn in chain_turns(...):
    ...
    for rollout in turn.rollouts():
        ...
        turn.log(rollout, log)
"""

import math
from collections.abc import Callable, Iterator
from copy import deepcopy
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor

from tstar_rl.chaining import turn_starts
from tstar_rl.chaining.chain_training import ChainTraining
from tstar_rl.chaining.signals import judge
from tstar_rl.chaining.trials import Trial, run_trial
from tstar_rl.chaining.turn_updates import TurnUpdates
from tstar_rl.env.layout import NUM_PHASES, PARTS
from tstar_rl.runs.chain_rows import calibration_rows, terminal_state_rows
from tstar_rl.transforms.terminal_state_reward import TerminalStateReward
from tstar_rl.updates import BehaviourCloningSettings

__all__ = ["Turn", "chain_turns"]


class Turn(TurnUpdates):
    """The training of one skill of the chain for some rollouts. What it learns with is in `TurnUpdates`."""

    def __init__(self, chain: ChainTraining, index: int, seed: int) -> None:
        super().__init__(chain, index, seed)
        self._before: dict[str, Any] = {}
        self._trained: dict[str, Any] = {}
        self.ended = False

    def rollouts(self) -> Iterator[TensorDictBase]:
        """The turn's rollouts (N, T), all of which a recipe must take; after the last one the gate judges the turn."""
        run, rollouts = self.run, self.chain.rollouts
        if self.chain.gate.settings.rejects:
            self._before = self._state()
        for number in range(rollouts):
            rollout = self._collect(1.0)
            self._log_terminal_states(rollout)
            yield rollout
            row = self._finish_rollout(rollout)
            if number == rollouts - 1:
                row |= self._end()
            run.log(self.steps, skill=self.index, round=run.turn // len(self.chain.skills), **row)
            if run.best.improved:
                self.chain.save("best", self.steps)
        self.ended = True

    def clone_from_ends(self, share: float, cloning: BehaviourCloningSettings) -> None:
        """Clones the expert where the skill before ends; see `turn_starts.clone_from_ends`."""
        turn_starts.clone_from_ends(self, share, cloning)

    def begin_where_it_fails(self, expected: Callable[[Tensor], Tensor], share: float) -> None:
        """Draws starts where failure is expected more often; see `turn_starts.begin_where_it_fails`."""
        turn_starts.begin_where_it_fails(self, expected, share)

    def _end(self) -> dict[str, float]:
        """Lets the gate judge; returns its columns. The first turn's trial_steps count the episodes before it, too."""
        found: dict[str, float] = {}
        judgement = self.chain.gate.judge(
            self.run.turn,
            self.index,
            undo=self._undo,
            redo=lambda: self._load(self._trained),
            tried=lambda trial: found.update(self._say_how_the_next_does(trial)),
        )
        self.chain.turn_order.note(judgement.kept, self.index, judgement.accepted is not False)
        if judgement.accepted is not False:
            self.chain.learned |= self.learned_here()
        if judgement.after is not None:
            self.chain.keep_outcomes(judgement.after, self.index if judgement.accepted is False else None)
        row = judgement.row(self.index) | found
        if self.run.turn == 0:
            row["trial_steps"] += self.chain.seeding_steps
        return row

    def _say_how_the_next_does(self, trial: Trial) -> dict[str, float]:
        """How the next skill did with the states it was handed in a trial, and what was said of them before."""
        if self.following is None:
            return {}
        handed = trial.skills[self.index + 1]
        found = {"handed": len(handed.starts), "next_success": handed.success}
        outcomes = {"success": handed.succeeded, "share": trial.share_from(self.index + 1)}
        signals = dict(self.signals)
        if self.has_learned("d_omega", self.following):
            signals["d_omega"] = TerminalStateReward(self.following.d_omega), "success"
        for name, (signal, label) in signals.items():
            columns, curve = judge(name, signal, handed.starts, handed.succeeded, outcomes[label])
            found |= columns
            if curve is not None:
                self.run.tables.calibration.extend(calibration_rows(self.steps, self.index, name, curve))
        return found

    def _state(self) -> dict[str, Any]:
        """A copy of everything that a turn changes, but for the simulations and the returns of the episodes in them."""
        state: dict[str, Any] = {"skill": self.skill.state_dict()}
        state["others"] = {
            index: skill.network_state()
            for index, skill in enumerate(self.chain.skills)
            if skill is not self.skill
        }
        updates = {name: each.state_dict() for name, each in self.kept.items() if name != "collection"}
        updates.get("update_policy", {}).pop("carried", None)
        return state | deepcopy(updates)  # an optimiser gives its own tensors

    def _undo(self) -> None:
        """Puts back what the turn has changed; what it is now can be loaded again."""
        self._trained = self._state()
        self._load(self._before)

    def _load(self, state: dict[str, Any]) -> None:
        """What `_state` gave."""
        self.skill.load_state_dict(state["skill"])
        for index, networks in state["others"].items():
            self.chain.skills[index].load_network_state(networks)
        updates = {name: each for name, each in state.items() if name not in ("skill", "others")}
        for name, each in deepcopy(updates).items():  # an optimiser takes them as its own
            self.kept[name].load_state_dict(each)

    def _log_terminal_states(self, rollout: TensorDictBase) -> None:
        settings = self.chain.settings
        if self.index == settings.logged_skill:
            reached = rollout["next", "observation"][rollout["next", "success"].squeeze(-1)]
            poses = reached[: settings.logged_states, PARTS:-NUM_PHASES]  # of all parts, (n, 7 P)
            self.run.tables.terminal_states.extend(terminal_state_rows(self.steps, self.index, poses))


def chain_turns(chain: ChainTraining) -> Iterator[Turn]:
    """Algorithm 1's second loop: turns of the skills in chain.order, `rounds` times; goes on from a checkpoint.

    A checkpoint is written after every turn.

    Args:
        chain: what is trained, and how.

    Raises:
        RuntimeError: if a recipe leaves a turn before its last rollout, which no trial has judged then.
    """
    run, skills = chain.run, chain.skills
    run.start(chain=chain, **{f"skill{index}": skill for index, skill in enumerate(skills)})
    if unknown := chain.never_judged():
        every, turns = chain.gate.settings.trial_every, chain.settings.rounds * len(skills)
        why = f"are too few for all with {turns} turns"
        if math.gcd(every, len(skills)) > 1:
            why = f"and the number of skills, {len(skills)}, have a factor in common"
        print(
            f"no trial follows a turn of skill {', '.join(map(str, unknown))}, so their hand-overs and signals are not "
            f"judged: trials after every {every} turns (chain.trial_every) {why}"
        )
    if run.turn == 0 and chain.settings.seed_episodes:
        chain.seed_sets(run_trial(skills, chain.workshop.seeding_trial(), chain.settings.path_steps))
    while run.turn < chain.settings.rounds * len(skills):
        index, seed = chain.turn_order.skill_of(run.turn), chain.workshop.turn_seed(run.turn)
        torch.manual_seed(seed)
        turn = Turn(chain, index, seed)
        yield turn
        if not turn.ended:
            raise RuntimeError(
                f"a recipe must take all of turn.rollouts(): turn {run.turn}, of skill {index}, was left before its end"
            )
        chain.end_turn(index)
        run.turn += 1
        run.save_if_due(0)
    chain.close()
    for place in sorted(chain.asked - chain.learned):
        print(
            f"{place} (skill/network): this network was to be taught as a signal, and no turn that was kept has taught "
            "it: nothing that it paid is left in this chain"
        )
    chain.save("last", run.env_steps)
    run.finish()
