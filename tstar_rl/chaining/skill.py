"""One link of the chain: the networks and the state sets of one subtask."""

import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from torch import nn

from tstar_rl.checks import InvalidValueError, did_you_mean
from tstar_rl.env.task_tables import is_piece, observation_dim
from tstar_rl.models.draws import generators_stay
from tstar_rl.models.network_settings import ACTIVATIONS, NetworkSettings
from tstar_rl.models.networks import Discriminator, make_discriminator, make_policy, make_value
from tstar_rl.models.normalizer import Normalizer, Standardizer
from tstar_rl.models.relative_features import RelativeFeatures
from tstar_rl.models.return_scale import ReturnScale
from tstar_rl.rollouts.labelled_sets import ApproachSet, OutcomeSet
from tstar_rl.rollouts.state_sets import InitiationSet, StateSet, TerminationSet
from tstar_rl.runs import checkpoint
from tstar_rl.runs.mismatch import CheckpointMismatchError
from tstar_rl.runs.saved_kinds import ONE_SKILL, kind_of

__all__ = ["Skill"]

APPROACH = 16
"""Approaching states kept for each start: an episode has many states and one end."""


class Skill:
    """What has been learned for subtask `subtask` of `task`.

    A skill always has a policy, a value network and the paper's two discriminators, f_phi and d_omega. A chaining
    method that needs a further network of the skill's states adds it under a name: it is then saved, moved and rolled
    back with the rest. So are the skill's sets of states.

    Attributes:
        initiation_set: I_i, states from which it has succeeded.
        termination_set: beta_i, states in which it has succeeded.
        outcomes: states in which it began, failed starts too, and what came of each.
        approaches: states on the way to a start of it, and how near they were; of `APPROACH` times the capacity.

    Args:
        task: furniture.
        subtask: 0-based; None for one policy of the whole task.
        settings: sizes of the networks.
        features: geometry of the subtask (`env.task_tables.subtask_geometry`), if the settings ask for features.
        capacity: of each set.
        obs_dim: numbers in an observation; None: as many as the piece of furniture called `task` has.
        actions: how many numbers of an action move the arm, and how many come after these: the first have the
            deviation action_std, the others hand_std. The default is that of the furniture.

    Raises:
        ValueError: if the settings ask for features and there is no geometry; if there is no such piece of furniture,
            and obs_dim is not given.
    """

    def __init__(
        self,
        task: str,
        subtask: int | None,
        settings: NetworkSettings,
        features: dict[str, Any] | None = None,
        capacity: int = 4096,
        obs_dim: int | None = None,
        actions: tuple[int, int] = (7, 2),
    ) -> None:
        if settings.features and features is None:
            raise ValueError("the settings ask for features, but no geometry was given for them")
        obs_dim = _obs_dim_of(task) if obs_dim is None else obs_dim
        self.task, self.subtask, self.settings, self.obs_dim = task, subtask, settings, obs_dim
        self.actions = actions
        self.geometry = features if settings.features else None
        self.normalizer = Normalizer(obs_dim)
        shared: dict[str, Any] = {
            "obs_dim": obs_dim,
            "activation": ACTIVATIONS[settings.activation],
            "normalizer": self.normalizer,
            "features": RelativeFeatures(self.geometry) if self.geometry is not None else None,
        }
        std = torch.tensor([settings.action_std] * actions[0] + [settings.hand_std] * actions[1])
        self.policy = make_policy(
            hidden=settings.hidden, std=settings.std, action_std=std, action_dim=sum(actions), **shared
        )
        of_value = settings.hidden if settings.value_hidden is None else settings.value_hidden
        self.value = make_value(hidden=of_value, **shared)
        self.networks = {name: self._make_network() for name in ("f_phi", "d_omega")}
        self.return_scale = ReturnScale()
        self.initiation_set, self.termination_set = InitiationSet(capacity), TerminationSet(capacity)
        self.outcomes, self.approaches = OutcomeSet(capacity), ApproachSet(APPROACH * capacity)

    @property
    def f_phi(self) -> Discriminator:
        """The GAIL discriminator."""
        return self.networks["f_phi"]

    @property
    def d_omega(self) -> Discriminator:
        """The discriminator of this skill's initiation set."""
        return self.networks["d_omega"]

    @property
    def sets(self) -> dict[str, StateSet]:
        """The sets of states by name."""
        names = ("initiation_set", "termination_set", "outcomes", "approaches")
        return {name: getattr(self, name) for name in names}

    def network(self, name: str) -> Discriminator:
        """The network of that name: observation (..., O) -> score (..., 1).

        Raises:
            InvalidValueError: if the skill has none; it lists those that it has.
        """
        if name not in self.networks:
            raise InvalidValueError(
                f"skill {self.subtask} has no network {name!r}; it has {', '.join(self.networks)}"
                f"{did_you_mean(name, self.networks)}. An update makes one, or add_network({name!r})"
            )
        return self.networks[name]

    def add_network(self, name: str, floor: float | None = None) -> Discriminator:
        """Makes a further network, observation (..., O) -> score (..., 1), unless there is one of that name.

        The numbers that it begins with depend on torch's global generator, which is left as it was.

        Args:
            name: of the network.
            floor: of a `Standardizer` of the network's own; None: a new one reads what the skill's normaliser gives.

        Raises:
            InvalidValueError: if the name is that of something else in a skill, or a floor is asked of a network that
                was made without one, or with another.
        """
        if name in ("policy", "value", "return_scale", "sets"):
            raise InvalidValueError(f"every skill has its own {name}: give the further network another name")
        if name not in self.networks:
            with generators_stay(self.initiation_set.device):
                self.networks[name] = self._make_network(floor).to(self.initiation_set.device)
        found = self.networks[name]
        has = float(found.normalizer.floor) if isinstance(found.normalizer, Standardizer) else None
        if floor is not None and (has is None or not math.isclose(has, floor, rel_tol=1e-5)):
            raise InvalidValueError(
                f"the network {name} of skill {self.subtask} has a floor of {has}, and {floor} is asked for: it was "
                "saved so, or made before the update that gives a floor"
            )
        return found

    def _make_network(self, floor: float | None = None) -> Discriminator:
        hidden = self.settings.discriminator_hidden
        activation = ACTIVATIONS[self.settings.discriminator_activation]
        normalizer = self.normalizer if floor is None else Standardizer(self.obs_dim, floor)
        return make_discriminator(self.obs_dim, hidden=hidden, activation=activation, normalizer=normalizer)

    def to(self, device: torch.device | str) -> "Skill":
        """Moves networks and sets; returns the skill."""
        for module in self.modules.values():
            module.to(device)
        for states in self.sets.values():
            states.to(device)
        return self

    @property
    def modules(self) -> dict[str, nn.Module]:
        """The networks by name, with their normaliser inside."""
        first: dict[str, nn.Module] = {"policy": self.policy, "value": self.value}
        return {**first, **self.networks, "return_scale": self.return_scale}

    def network_state(self) -> dict[str, Any]:
        """Copies of all parameters and buffers."""
        return {
            name: {key: value.clone() for key, value in module.state_dict().items()}
            for name, module in self.modules.items()
        }

    def load_network_state(self, state: dict[str, Any]) -> None:
        """What `network_state` gave. A further network that was made since stays as it is."""
        for name, values in state.items():
            module = self.modules.get(name)
            if module is None:
                floor = values.get("normalizer.floor")  # of a network that standardises its own input
                module = self.add_network(name, None if floor is None else float(floor))
            module.load_state_dict(values)

    def state_dict(self) -> dict[str, Any]:
        """Networks and sets."""
        sets = {name: states.state_dict() for name, states in self.sets.items()}
        return {**self.network_state(), "sets": sets}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """What `state_dict` gave. A set that the skill did not have yet when it was saved is empty."""
        self.load_network_state({name: values for name, values in state.items() if name != "sets"})
        for name, states in self.sets.items():
            if name in state["sets"]:
                states.load_state_dict(state["sets"][name])
            else:
                states.clear()

    def built(self) -> dict[str, Any]:
        """What it was made with, as plain values: see `from_built`. Its sets are of "capacity"."""
        return {
            "settings": asdict(self.settings),
            "obs_dim": self.obs_dim,
            "actions": list(self.actions),
            "geometry": checkpoint.to_plain(self.geometry),
            "capacity": self.initiation_set.capacity,
        }

    @classmethod
    def from_built(cls, task: str, subtask: int | None, built: Mapping[str, Any]) -> "Skill":
        """A new skill of the sizes of the one that said `built`; without a capacity its sets are of one state.

        Raises:
            CheckpointMismatchError: if its networks have a setting that this version does not know.
        """
        return cls(
            task,
            subtask,
            checkpoint.settings_of(NetworkSettings, built["settings"], "the networks have"),
            checkpoint.to_tensors(built["geometry"]),
            built.get("capacity", 1),
            built["obs_dim"],
            tuple(built.get("actions", (7, 2))),  # older skills do not say: they are of the furniture
        )

    def save(self, path: str | Path, **record: Any) -> None:
        """Writes the skill, and beside it plain values that say what it is."""
        told = {"task": self.task, "subtask": self.subtask, "built": self.built(), **record}
        checkpoint.save(path, {"skill": self}, told)

    @classmethod
    def load(cls, path: str | Path, **expected: Any) -> "Skill":
        """Builds the skill saved at `path`.

        Raises:
            FileNotFoundError: if there is none.
            CheckpointMismatchError: if what is `expected` (task=..., subtask=...) is not what it was saved with, or a
                newer version saved it.
            InvalidValueError: if something else is saved there.
        """
        record = checkpoint.read_record(path, **expected)
        if (kind := kind_of(record)) != ONE_SKILL:
            raise InvalidValueError(
                f"{path} is {kind}; a chain is made of skills of bc, ppo, gail or gail_ppo"
            )
        try:
            skill = cls.from_built(record["task"], record["subtask"], record["built"])
        except CheckpointMismatchError as error:
            raise CheckpointMismatchError(f"{path}: {error}") from error
        checkpoint.load(path, {"skill": skill}, **expected)
        return skill


def _obs_dim_of(task: str) -> int:
    if not is_piece(task):
        raise InvalidValueError(f"obs_dim must be given for {task!r}, which is no piece of furniture here")
    return observation_dim(task)
