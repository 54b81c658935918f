"""The turns of skill chaining: each trains one skill of a chain, while the others stand still.

for turn in chain_turns(...):
    ...
    for rollout in turn.rollouts():
        ...
        turn.log(rollout, log)
"""

from collections.abc import Iterator
from copy import deepcopy
from typing import Any, NamedTuple

import torch
from tensordict import TensorDictBase

from tstar_rl.chaining.calibration import area_under_curve
from tstar_rl.chaining.chain import save_chain
from tstar_rl.chaining.chain_training import ChainTraining
from tstar_rl.chaining.skill import Skill
from tstar_rl.chaining.training import Training
from tstar_rl.chaining.trials import Trial, run_trial
from tstar_rl.env.layout import NUM_PHASES, PARTS
from tstar_rl.updates import DiscriminatorSettings, DiscriminatorUpdate, PolicyUpdate

__all__ = ["Seam", "Turn", "chain_turns"]


class Seam(NamedTuple):
    """Two skills, one after the other."""

    before: Skill
    after: Skill


class Turn(Training):
    """The training of one skill of the chain for some rollouts.

    Attributes:
        index: of the skill, 0-based.
        skill: trained in this turn.
        following: the next skill; None after the last.
        seam: the skills whose states d_omega is trained on in this turn; None where there is no such seam.
    """

    def __init__(self, chain: ChainTraining, index: int, seed: int) -> None:
        skills = chain.skills
        previous = skills[index - 1] if index else None
        self.kept = chain.kept_by(index)
        collection = self.kept.get("collection")
        if collection is None:
            before = None if previous is None else previous.termination_set
            collection = self.kept["collection"] = chain.workshop.collection(skills[index], seed, before)
            chain.restore(index, "collection")
        super().__init__(skills[index], chain.experts[index], chain.run, chain.training, collection, seed)
        self.chain, self.index = chain, index
        self.following = skills[index + 1] if index + 1 < len(skills) else None
        seam = (self.skill, self.following) if chain.settings.d_omega_of == "next" else (previous, self.skill)
        self.seam = None if None in seam else Seam(*seam)  # pyright: ignore[reportArgumentType]
        self._before: dict[str, Any] = {}

    def discriminator_update(
        self, name: str, skill: Skill, settings: DiscriminatorSettings, **labels: float
    ) -> DiscriminatorUpdate:
        """See `Training`; where a chain carries over, that of the skill's last turn goes on."""
        known = self.kept.get(f"update_{name}")
        return known or self._keep(
            f"update_{name}", super().discriminator_update(name, skill, settings, **labels)
        )

    def policy_update(self) -> PolicyUpdate:
        """See `Training`; where a chain carries over, that of the skill's last turn goes on."""
        return self.kept.get("update_policy") or self._keep("update_policy", super().policy_update())

    def _keep(self, name: str, made: Any) -> Any:
        self.kept[name] = made
        self.chain.restore(self.index, name)
        return made

    def chained(self, rollout: TensorDictBase) -> TensorDictBase:
        """The rows of a rollout whose terminal states join beta_i, as chain.kept_states says.

        "all" (Algorithm 1): all rows. "chained" (the released code): those of episodes that began where the skill
        before ended; of the first skill, all.
        """
        if self.index == 0 or self.chain.settings.kept_states == "all":
            return rollout
        return rollout[rollout["start_chained"].squeeze(-1)]

    def rollouts(self) -> Iterator[TensorDictBase]:
        """The turn's rollouts (N, T); after the last one the gate judges what the turn has changed."""
        run, settings = self.run, self.chain.settings
        self._before = self._state()
        for number in range(settings.rollouts):
            rollout = self._collect(1.0)
            self._log_terminal_states(rollout)
            yield rollout
            row = self._finish_rollout(rollout)
            if number == settings.rollouts - 1:
                row |= self._end()
            run.log(self.steps, skill=self.index, round=run.turn // len(self.chain.skills), **row)
            if run.improved:
                self.chain.save("best", self.steps)

    def _end(self) -> dict[str, float]:
        """Lets the gate judge; returns its columns."""
        trained = self._state()
        judgement = self.chain.gate.judge(
            self.run.turn, undo=lambda: self._load(self._before), redo=lambda: self._load(trained)
        )
        row = judgement.row(self.index)
        return row if judgement.after is None else row | self._say_how_the_next_does(judgement.after)

    def _say_how_the_next_does(self, trial: Trial) -> dict[str, float]:
        """How the next skill did with the states it was handed in a trial, and what a trained d_omega says of them."""
        if self.following is None:
            return {}
        handed = trial.skills[self.index + 1]
        found = {"handed": len(handed.starts), "next_success": handed.success}
        if not self.chain.has_made("update_d_omega"):
            return found
        with torch.no_grad():
            scores = self.following.d_omega(handed.starts).squeeze(-1)
        return found | {
            "d_omega_auc": area_under_curve(scores, handed.succeeded),
            "d_omega_sd": float(scores.std()) if len(scores) > 1 else float("nan"),
        }

    def _state(self) -> dict[str, Any]:
        """A copy of everything that a turn changes, but for the simulations."""
        state: dict[str, Any] = {"skill": self.skill.state_dict()}
        if self.following is not None:
            state["following"] = self.following.network_state()
        updates = {name: each for name, each in self.kept.items() if name != "collection"}
        return deepcopy(state | {name: each.state_dict() for name, each in updates.items()})

    def _load(self, state: dict[str, Any]) -> None:
        """What `_state` gave. Updates that have been made since start with it anew."""
        state = deepcopy(state)
        self.skill.load_state_dict(state.pop("skill"))
        if self.following is not None:
            self.following.load_network_state(state.pop("following"))
        for name, each in state.items():
            self.kept[name].load_state_dict(each)

    def _log_terminal_states(self, rollout: TensorDictBase) -> None:
        settings = self.chain.settings
        if self.index == settings.logged_skill:
            reached = rollout["next", "observation"][rollout["next", "success"].squeeze(-1)]
            poses = reached[: settings.logged_states, PARTS:-NUM_PHASES]  # of all parts, (n, 7 P)
            self.run.log_terminal_states(self.steps, self.index, poses)


def chain_turns(chain: ChainTraining, **record: Any) -> Iterator[Turn]:
    """Algorithm 1's second loop: turns of the skills in order, `rounds` times; goes on from a checkpoint.

    A checkpoint is written after every turn.

    Args:
        chain: what is trained, and how.
        **record: plain values that are saved with the best and the last chain.
    """
    run, skills = chain.run, chain.skills

    def save(name: str, steps: int) -> None:
        save_chain(skills, run.work / name, **record, env_steps=steps)

    chain.save = save
    run.start(chain=chain, **{f"skill{index}": skill for index, skill in enumerate(skills)})
    if run.turn == 0 and chain.settings.seed_episodes:
        chain.seed_sets(run_trial(skills, chain.workshop.seeding_trial()))
    while run.turn < chain.settings.rounds * len(skills):
        index, seed = run.turn % len(skills), chain.workshop.turn_seed(run.turn)
        torch.manual_seed(seed)
        yield Turn(chain, index, seed)
        chain.end_turn(index)
        run.turn += 1
        run.save_if_due(0)
    chain.close()
    save("last", run.env_steps)
    run.finish()
