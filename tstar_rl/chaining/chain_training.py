"""What all turns of a chain share: its skills, its environments, and what goes on from one turn to the next."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

from tensordict import TensorDict
from torchrl.envs import TransformedEnv

from tstar_rl.chaining.chain import save_chain
from tstar_rl.chaining.chain_settings import ChainSettings
from tstar_rl.chaining.gate import Gate
from tstar_rl.chaining.skill import Skill
from tstar_rl.chaining.training import TrainingSettings
from tstar_rl.chaining.trials import Trial
from tstar_rl.chaining.turn_order import TurnOrder
from tstar_rl.checks import InvalidValueError
from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.rollouts.collection import Collection
from tstar_rl.rollouts.ray_collection import RayCollection
from tstar_rl.rollouts.state_sets import TerminationSet
from tstar_rl.runs.run import Run

__all__ = ["ChainTraining", "Workshop"]


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

    def demonstrations(
        self, subtask: int, before: TerminationSet, episodes: int, seed: int
    ) -> Demonstrations:
        """Successes of the expert at a subtask, from states of the termination set of the skill before."""
        ...

    def seeding_trial(self) -> TransformedEnv:
        """Where the chain is tried before the first turn."""
        ...

    def trial(self) -> TransformedEnv:
        """Where the whole chain is tried, always from the same starts."""
        ...


@dataclass
class ChainTraining:
    """A chain in training.

    Attributes:
        skills: the chain, fine-tuned in place.
        experts: demonstrations of each subtask.
        run: log and checkpoints.
        settings: see `ChainSettings`.
        rollouts: in one turn.
        training: see `TrainingSettings`.
        workshop: makes the environments.
        gate: judges each turn.
        record: plain values that are saved with the chain.
        turn_order: says whose turn it is.
        learned: networks of scores that a turn has trained and that were not put back, as "<index>/<name>".
        asked: networks that a turn wanted as its reward, or was to teach for the next skill; those that never learned
            are told at the end.
        seeding_steps: environment steps of the episodes before the first turn, which the first turn's row counts.
    """

    skills: Sequence[Skill]
    experts: Sequence[Demonstrations]
    run: Run
    settings: ChainSettings
    rollouts: int
    training: TrainingSettings
    workshop: Workshop
    gate: Gate
    record: Mapping[str, Any] = field(default_factory=dict)
    turn_order: TurnOrder = field(init=False)
    learned: set[str] = field(default_factory=set)
    asked: set[str] = field(default_factory=set)
    seeding_steps: int = 0
    _kept: dict[int, dict[str, Any]] = field(default_factory=dict)
    _own: dict[int, set[str]] = field(default_factory=dict)
    _waiting: dict[str, Any] = field(default_factory=dict)
    """States of what a resumed run has not made yet, as "<index>/<name>"."""

    def __post_init__(self) -> None:
        if len(self.experts) != len(self.skills) or self.rollouts < 1:
            raise InvalidValueError(
                "a chain needs demonstrations for each skill and a rollout in each turn; got "
                f"{len(self.skills)} skills, {len(self.experts)} experts and rollouts={self.rollouts}"
            )
        if self.settings.order == "costliest" and not self.gate.settings.every_turn:
            raise InvalidValueError(
                'order="costliest" needs a trial after every turn: a gate that rejects, or trial_every=1; got '
                f"{self.gate.settings.trial_every}"
            )
        self.turn_order = TurnOrder(self.settings.order, len(self.skills))

    def save(self, name: str, steps: int) -> None:
        """Writes the chain under a name, with its record and the environment steps done."""
        save_chain(self.skills, self.run.work / name, **self.record, env_steps=steps)

    def seed_sets(self, trial: Trial) -> None:
        """Fills the sets with the states of a trial before the first turn, and notes its steps.

        From where each skill succeeded, and where it then was.
        """
        for skill, found in zip(self.skills, trial.skills, strict=True):
            starts = found.starts[found.succeeded]
            skill.initiation_set.extend(TensorDict({"observation": starts}, [len(starts)]))
            skill.termination_set.extend(found.ends)
        self.keep_outcomes(trial)
        self.turn_order.note(trial)
        self.seeding_steps = trial.steps()

    def keep_outcomes(self, trial: Trial, rejected: int | None = None) -> None:
        """Adds what a trial tells of all starts, failed ones too, and of the states on the way to them.

        What did not change since the trial before is added again: its starts weigh more, with the share of the chain
        that follows them now.

        Args:
            trial: of the chain.
            rejected: the skill whose turn was put back after this trial. That skill, and those before it, are not the
                chain that was tried any more, so what the trial tells of them is left out.
        """
        for index, (skill, found) in enumerate(zip(self.skills, trial.skills, strict=True)):
            if rejected is not None and index <= rejected:
                continue
            skill.outcomes.add(found.starts, found.succeeded, trial.share_from(index))
            if index + 1 < len(self.skills):
                path, following = found.path, self.skills[index + 1]
                following.approaches.add(path.states, path.steps_left, trial.handed_over(index))

    def never_judged(self) -> list[int]:
        """Skills that hand over and whose turns no trial follows, where there are trials: see `GateSettings`."""
        every, skills = self.gate.settings.trial_every, len(self.skills)
        turns = range(every - 1, min(self.settings.rounds, every) * skills, every)
        if self.gate.settings.rejects or self.settings.order == "costliest" or not turns:
            return []
        return sorted(set(range(skills - 1)) - {self.turn_order.skill_of(turn) for turn in turns})

    def kept_by(self, index: int) -> dict[str, Any]:
        """The updates and the collection of skill `index`, by name; a turn adds those that it makes."""
        return self._kept.setdefault(index, {})

    def own_by(self, index: int) -> set[str]:
        """The names among `kept_by` of updates that are a recipe's own."""
        return self._own.setdefault(index, set())

    def restore(self, index: int, name: str) -> None:
        """Loads the state that a checkpoint had of something which has just been made."""
        state = self._waiting.pop(f"{index}/{name}", None)
        if state is not None:
            self._kept[index][name].load_state_dict(state)

    def end_turn(self, index: int) -> None:
        """Drops what skill `index` does not carry over, and the weights of the states that its episodes began in.

        Workers of a cluster are never carried over: the next turn's need their places.
        """
        kept = self._kept[index]
        if index:
            self.skills[index - 1].termination_set.weigh(None)
        if not self.settings.carry_over or isinstance(kept["collection"], RayCollection):
            kept.pop("collection").close()
        if not self.settings.carry_over:
            kept.clear()
            self.own_by(index).clear()

    def close(self) -> None:
        """Frees the simulations."""
        for collection in self._collections():
            collection.close()

    def settle(self) -> None:
        """See `Collection.settle`."""
        for collection in self._collections():
            collection.settle()

    def _collections(self) -> list[Any]:
        return [kept["collection"] for kept in self._kept.values() if "collection" in kept]

    def state_dict(self) -> dict[str, Any]:
        """Of all that is carried over."""
        made = {
            f"{index}/{name}": each.state_dict()
            for index, kept in self._kept.items()
            for name, each in kept.items()
        }
        state = {"carried": {**self._waiting, **made}, "turn_order": self.turn_order.state_dict()}
        networks = [
            (index, *each) for index, skill in enumerate(self.skills) for each in skill.networks.items()
        ]
        coarse = [f"{index}/{name}" for index, name, network in networks if network.coarse]
        return state | {"coarse": coarse, "learned": sorted(self.learned), "asked": sorted(self.asked)}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """What `state_dict` gave; each is loaded when its turn comes."""
        self._waiting = dict(state["carried"])
        self.turn_order.load_state_dict(state["turn_order"])
        # What trains a network also sets `coarse`, and may not be made again before the network pays a turn. A further
        # network is made here: components are loaded by name, the chain before its skills.
        for place in state.get("coarse", ()):
            index, _, name = place.partition("/")
            self.skills[int(index)].add_network(name).coarse = True
        self.learned, self.asked = set(state.get("learned", ())), set(state.get("asked", ()))
