"""A skill in training: what every recipe needs beside its algorithm.

A recipe makes its updates and loops over `rollouts()`. Everything else happens between two rollouts: exploration, the
normaliser, the log, the best so far, checkpoints, going on after a kill.


    for rollout in training.rollouts():
        log = update_policy(reward(rollout), training.progress)
        training.log(rollout, log)
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from tensordict import TensorDictBase
from torch import Tensor

from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import InvalidValueError
from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.models.draws import generators_stay
from tstar_rl.models.exploration import Exploration
from tstar_rl.rollouts.collection import Collection, rollout_metrics
from tstar_rl.rollouts.ray_collection import RayCollection
from tstar_rl.runs.run import Run
from tstar_rl.updates import (
    DiscriminatorSettings,
    DiscriminatorUpdate,
    LabelledSettings,
    LabelledUpdate,
    PolicyUpdate,
    PPOSettings,
)

__all__ = ["AnyUpdate", "Distance", "Training", "TrainingSettings", "Update"]

OF_THE_LIBRARY = ("policy", "f_phi", "d_omega")
"""Names whose updates are the library's in every recipe."""
Distance = Callable[[Tensor, Tensor], Tensor]
"""From what a network says of states and their labels, of one shape, to a scalar."""


class Update(Protocol):
    """What learns from rollouts, and can go on after a kill."""

    def state_dict(self) -> dict[str, Any]:
        """Everything that it has learned and needs to go on: optimisers, and networks that are no skill's."""
        ...

    def load_state_dict(self, state_dict: dict[str, Any]) -> Any:
        """What `state_dict` gave."""
        ...


AnyUpdate = TypeVar("AnyUpdate", bound=Update)


@dataclass(frozen=True)
class TrainingSettings:
    """What is done to a skill in training, whichever recipe trains it."""

    ppo: PPOSettings
    exploration: Exploration | None
    """None: the deviation is left alone."""
    running_normalizer: bool
    normalizer_floor: float


class Training:
    """One skill, its rollouts and its updates.

    Args:
        skill: trained in place.
        expert: demonstrations of its subtask.
        run: log and checkpoints.
        settings: see `TrainingSettings`.
        collection: makes rollouts with the skill's policy.
        seed: of the updates.

    Raises:
        InvalidValueError: if the run was not given a total.
    """

    def __init__(
        self,
        skill: Skill,
        expert: Demonstrations,
        run: Run,
        settings: TrainingSettings,
        collection: Collection | RayCollection,
        seed: int,
    ) -> None:
        if run.total is None:
            raise InvalidValueError(
                "a training ends when its run's steps are done: give Run(..., total=<steps>)"
            )
        self.skill, self.expert, self.run, self.settings = skill, expert, run, settings
        self.total = run.total
        self.collection, self.seed, self.steps = collection, seed, run.env_steps
        self.own: set[str] = set()
        """Names of the updates that `keep` made."""
        self._row: dict[str, Any] | None = None
        self._collects = False

    @property
    def progress(self) -> float:
        """The share of the run's steps that has been collected, in [0, 1]."""
        return min(self.steps / self.total, 1.0)  # the last rollout may end beyond

    def discriminator_update(
        self, name: str, skill: Skill, settings: DiscriminatorSettings, **labels: float
    ) -> DiscriminatorUpdate:
        """The update of a skill's network `name`, which is to say `labels` of two kinds of states."""
        update = DiscriminatorUpdate(name, skill.add_network(name), labels, settings, self.seed)
        return self._keep(f"update_{name}", update)

    def labelled_update(
        self, name: str, skill: Skill, distance: Distance, settings: LabelledSettings
    ) -> LabelledUpdate:
        """The update of a skill's network `name`, which is to say the label of every state; see `LabelledLoss`."""
        network = skill.add_network(name, settings.floor)
        update = LabelledUpdate(name, network, distance, settings, self.seed)
        return self._keep(f"update_{name}", update)

    def policy_update(self) -> PolicyUpdate:
        """PPO of the skill's policy and value network."""
        skill = self.skill
        update = PolicyUpdate(skill.policy, skill.value, self.settings.ppo, skill.return_scale, self.seed)
        return self._keep("update_policy", update)

    def keep(self, name: str, make: Callable[[], AnyUpdate]) -> AnyUpdate:
        """An update of a recipe's own: saved with the run, put back by the gate with the turn, and gone on with.

        To be called before the first rollout, as the other updates are.

        Args:
            name: of it.
            make: makes a new one; what it draws leaves torch's generator as it was, so that a run that goes on draws as
                one that was not stopped. Networks of a skill that it trains are saved with that skill; what else it has
                is in its state.

        Raises:
            InvalidValueError: if it has no state, see `Update`, the name is that of another update, or there was a
                rollout already.
        """
        if name in OF_THE_LIBRARY:
            raise InvalidValueError(
                f"keep({name!r}): {name} has an update of the library's; give yours another name"
            )
        if (known := self._carried(name)) is not None:
            if name not in self.own:
                raise InvalidValueError(
                    f"keep({name!r}): it is the library's update of a network; give yours another name"
                )
            return known
        with generators_stay(self.skill.initiation_set.device):
            made = make()
        if not all(callable(getattr(made, method, None)) for method in ("state_dict", "load_state_dict")):
            raise InvalidValueError(
                f"keep({name!r}) takes what makes an update with state_dict and load_state_dict, so that a run goes on "
                f"where it stopped; {type(made).__name__} lacks one"
            )
        self.own.add(name)
        return self._keep(f"update_{name}", made)

    def _carried(self, name: str) -> Any:
        """The update of that name that a turn before has kept, where a chain carries over; None: there is none."""
        return None

    def _keep(self, name: str, made: AnyUpdate) -> AnyUpdate:
        """Keeps an update, so that a checkpoint has its state; returns it.

        Raises:
            InvalidValueError: after the first rollout: neither a checkpoint nor the gate would know of it.
        """
        if self._collects:
            raise InvalidValueError(
                f"{name} is made after the first rollout, and a run that is resumed would go on with a fresh one: make "
                "it before the loop over rollouts()"
            )
        return made

    def log(self, rollout: TensorDictBase, log: Mapping[str, Any]) -> None:
        """Notes what the recipe has found of this rollout; the row is written before the next one."""
        self._row = {**rollout_metrics(rollout, self._apart(rollout)), **log, **self.collection.counts()}

    def _apart(self, rollout: TensorDictBase) -> Tensor | None:
        """Which rows (N, T, 1) are of episodes that are counted apart, see `rollout_metrics`; None: all count."""
        return None

    def _collect(self, progress: float) -> TensorDictBase:
        """The next rollout, with the exploration of `progress`."""
        self._collects = True
        if self.settings.exploration is not None and self.skill.settings.std == "fixed":
            self.settings.exploration.apply(self.skill.policy, progress, self.skill.actions)
        rollout = self.collection.rollout()
        self.steps += rollout.numel()
        return rollout

    def _finish_rollout(self, rollout: TensorDictBase) -> dict[str, Any]:
        """Updates the normaliser; returns the row that the recipe logged.

        Raises:
            RuntimeError: if it logged none.
        """
        if self._row is None:
            raise RuntimeError("a recipe must call log(rollout, ...) for every rollout: the last one was not")
        if self.settings.running_normalizer:
            self.skill.normalizer.update(rollout["observation"], self.settings.normalizer_floor)
        row, self._row = self._row, None
        return row
