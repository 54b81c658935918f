"""What a turn learns with: updates that go on from turn to turn, the seams of its skill, and signals."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any, TypeVar

from tensordict import TensorDictBase
from torch import Tensor

from tstar_rl.chaining.chain_training import ChainTraining
from tstar_rl.chaining.seam import Seam
from tstar_rl.chaining.signals import OnceLearned, Signal, critic_errors, outcomes_of
from tstar_rl.chaining.skill import Skill
from tstar_rl.chaining.training import AnyUpdate, Distance, Training
from tstar_rl.chaining.warm_up import check_that_policies_learn
from tstar_rl.checks import InvalidValueError
from tstar_rl.models.networks import Discriminator
from tstar_rl.rollouts.labels import LABELS, Label
from tstar_rl.updates import (
    DiscriminatorSettings,
    DiscriminatorUpdate,
    LabelledSettings,
    LabelledUpdate,
    PolicyUpdate,
)
from tstar_rl.updates.sampled import SampledUpdate

__all__ = ["TurnUpdates"]

AnySignal = TypeVar("AnySignal", bound=Signal)
Scoring = TypeVar("Scoring", bound=SampledUpdate)
Known = TypeVar("Known", DiscriminatorUpdate, LabelledUpdate)


class TurnUpdates(Training):
    """A turn's skill among its neighbours, and what changes networks in it.

    Attributes:
        index: of the skill, 0-based.
        skill: trained in this turn.
        previous: the skill before; None before the first.
        following: the next skill; None after the last.
        seam: the skills whose states d_omega is trained on in this turn; None where there is no such seam.
        seams: that with the skill before and that with the next skill, those that there are.
        signals: by name, what pays this turn and is judged at its end, and by which label; see `signal`.
        taught: the updates of networks of scores that this turn makes, by network, as in `ChainTraining.learned`.
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
        self.own = chain.own_by(index)
        self.chain, self.index, self.previous = chain, index, previous
        self.following = skills[index + 1] if index + 1 < len(skills) else None
        seam = (self.skill, self.following) if chain.settings.d_omega_of == "next" else (previous, self.skill)
        self.seam = None if None in seam else Seam(*seam)  # pyright: ignore[reportArgumentType]
        around = [each for each in (previous, self.skill, self.following) if each is not None]
        self.seams = [Seam(*both) for both in pairwise(around)]
        self.signals: dict[str, tuple[Signal, Label]] = {}
        self.taught: dict[str, SampledUpdate] = {}

    def discriminator_update(
        self, name: str, skill: Skill, settings: DiscriminatorSettings, **labels: float
    ) -> DiscriminatorUpdate:
        """See `Training`; where a chain carries over, that of the skill's last turn goes on."""
        known = self._known(DiscriminatorUpdate, name, skill, settings)
        if known is not None and list(known.loss.labels.items()) != list(labels.items()):
            raise InvalidValueError(f"update_{name} goes on with labels {known.loss.labels}, got {labels}")
        return self._teach(
            name, skill, known or super().discriminator_update(name, skill, settings, **labels)
        )

    def labelled_update(
        self, name: str, skill: Skill, distance: Distance, settings: LabelledSettings
    ) -> LabelledUpdate:
        """See `Training`; where a chain carries over, that of the skill's last turn goes on."""
        if skill is self.following:  # what pays this turn
            self.chain.asked.add(f"{skill.subtask}/{name}")
        known = self._known(LabelledUpdate, name, skill, settings)
        if known is not None and known.loss.distance is not distance:
            raise InvalidValueError(
                f"update_{name} goes on with the distance of the skill's last turn, got another: give one function, "
                "made once, in every turn"
            )
        return self._teach(name, skill, known or super().labelled_update(name, skill, distance, settings))

    def learned(self, name: str, skill: Skill) -> Discriminator | None:
        """A skill's network that a turn before has trained, with data, and that was kept; else None."""
        return skill.network(name) if f"{skill.subtask}/{name}" in self.chain.learned else None

    def once_learned(self, name: str, skill: Skill) -> OnceLearned:
        """A skill's network as what pays: it says 0 of every state until this turn, or a kept one, has trained it."""
        self.chain.asked.add(f"{skill.subtask}/{name}")
        return OnceLearned(skill.network(name), lambda: self.has_learned(name, skill))

    def has_learned(self, name: str, skill: Skill) -> bool:
        """Whether this turn, or one before that was kept, has trained a skill's network, with data."""
        place = f"{skill.subtask}/{name}"
        return place in self.chain.learned or place in self.learned_here()

    def learned_here(self) -> set[str]:
        """The networks of scores that this turn has trained, with data, as in `ChainTraining.learned`."""
        return {place for place, update in self.taught.items() if update.has_learned}

    def policy_update(self) -> PolicyUpdate:
        """See `Training`; where a chain carries over, that of the skill's last turn goes on.

        Raises:
            InvalidValueError: the critic alone would learn in all turns of a skill.
        """
        of, warm_up = self.chain.settings, self.settings.ppo.critic_warmup
        check_that_policies_learn(warm_up, self.chain.rollouts, of.rounds, of.carry_over, of.order)
        return self.kept.get("update_policy") or super().policy_update()

    def _carried(self, name: str) -> Any:
        return self.kept.get(f"update_{name}")

    def _known(self, kind: type[Known], name: str, skill: Skill, settings: Any) -> Known | None:
        """The update of a name that is there already, or None.

        Raises:
            InvalidValueError: if it is of another kind, of another skill's network, or has other settings.
        """
        known = self._carried(name)
        if known is not None and not isinstance(known, kind):
            raise InvalidValueError(
                f"update_{name} is a {type(known).__name__} already, not a {kind.__name__}: give the network another "
                "name"
            )
        if known is not None and known.settings != settings:
            raise InvalidValueError(
                f"update_{name} goes on with {known.settings}, got {settings}: give it the same in every turn, or set "
                "chain.carry_over=false"
            )
        if known is not None and known.loss.network is not skill.networks.get(name):
            raise InvalidValueError(
                f"a turn has one update of {name}, and it is of another skill than {skill.subtask}"
            )
        return known

    def _teach(self, name: str, skill: Skill, update: Scoring) -> Scoring:
        self.taught[f"{skill.subtask}/{name}"] = update
        return update

    def _keep(self, name: str, made: AnyUpdate) -> AnyUpdate:
        self.kept[name] = super()._keep(name, made)
        self.chain.restore(self.index, name)
        return made

    def chained(self, rollout: TensorDictBase) -> TensorDictBase:
        """The rows of a rollout whose terminal states join beta_i, as chain.kept_states says.

        "all" (Algorithm 1): all rows. "chained": those of episodes that began in a chained start, a state in which the
        skill before ended or a draw of the Gaussian of such states; of the first skill, all. The released code has a
        list for starts, which takes those, and one for D_omega, which takes all; beta_i is both.
        """
        if self.index == 0 or self.chain.settings.kept_states == "all":
            return rollout
        return rollout[rollout["start_chained"].squeeze(-1)]

    def signal(self, name: str, signal: AnySignal, label: Label = "success") -> AnySignal:
        """Notes that a signal pays this turn, so that a trial after it is judged by a label; returns the signal.

        Without a gate there is a trial after every `chain.trial_every` turns alone.

        Raises:
            InvalidValueError: if it cannot be asked what it says of a state, see `Signal`; for another label.
        """
        if label not in LABELS:
            raise InvalidValueError(
                f"turn.signal({name!r}): label must be one of {', '.join(LABELS)}; got {label!r}"
            )
        if not hasattr(signal, "said"):
            raise InvalidValueError(
                f"turn.signal({name!r}) takes what has said(obs), (n, O) -> (n, 1), by which the turn judges it; "
                f"{type(signal).__name__} has none"
            )
        self.signals[name] = signal, label
        return signal

    def outcomes(
        self, rollout: TensorDictBase, later: Callable[[Tensor], Tensor] | None = None
    ) -> tuple[Tensor, Tensor, Tensor]:
        """What came of the skill's starts in a rollout, for `OutcomeSet.add`; which rows, see `chained`.

        Args:
            rollout: (N, T).
            later: what is said of the rest of the chain where the skill succeeded; None after the last skill, and while
                nothing has been learned of it: the rest counts as not done.
        """
        return outcomes_of(self.chained(rollout), len(self.chain.skills) - self.index, later)

    def critic_errors(self, rollout: TensorDictBase, scale: float) -> tuple[Tensor, Tensor]:
        """See `signals.critic_errors`; which rows, see `chained`."""
        ppo = self.settings.ppo
        unit = float(self.skill.return_scale.deviation) if ppo.normalize_returns else 1.0
        return critic_errors(self.chained(rollout), self.skill, ppo.gamma, unit, scale)
