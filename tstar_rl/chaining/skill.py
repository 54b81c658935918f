"""One link of the chain: the networks and the state sets of one subtask."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from torch import nn

from tstar_rl.env.layout import FIVE_PARTS
from tstar_rl.models.networks import make_discriminator, make_policy, make_value
from tstar_rl.models.normalizer import Normalizer
from tstar_rl.models.relative_features import RelativeFeatures
from tstar_rl.models.return_scale import ReturnScale
from tstar_rl.rollouts.state_sets import InitiationSet, TerminationSet
from tstar_rl.runs import checkpoint

__all__ = ["NetworkSettings", "Skill"]

ACTIVATIONS = {"relu": nn.ReLU, "tanh": nn.Tanh}


@dataclass(frozen=True)
class NetworkSettings:
    """Source: the paper's appendix for the defaults; without features it sees the observation alone."""

    hidden: tuple[int, ...] = (128, 256)
    activation: str = "relu"
    std: str = "state"
    action_std: float = 0.1
    hand_std: float = 0.1
    """Deviation of the gripper and connect actions."""
    features: bool = False
    """Whether policy and value also see `RelativeFeatures`."""
    discriminator_hidden: tuple[int, ...] = (256, 256)
    discriminator_activation: str = "tanh"

    def __post_init__(self) -> None:
        for name in (self.activation, self.discriminator_activation):
            if name not in ACTIVATIONS:
                raise ValueError(f"activation must be one of {', '.join(ACTIVATIONS)}; got {name!r}")


class Skill:
    """What subtask `subtask` of `task` has learnt.

    Args:
        task: furniture.
        subtask: 0-based; None for one policy of the whole task.
        settings: sizes of the networks.
        features: what `FurnitureEnv.features(subtask)` gives, if the settings ask for features.
        capacity: of the two sets.
        obs_dim: numbers in an observation of the task, `features.observation_size` of its parts.
    """

    def __init__(
        self,
        task: str,
        subtask: int | None,
        settings: NetworkSettings,
        features: dict[str, Any] | None = None,
        capacity: int = 4096,
        obs_dim: int = FIVE_PARTS,
    ) -> None:
        if settings.features and features is None:
            raise ValueError("the settings ask for features, but no geometry was given for them")
        self.task, self.subtask, self.settings, self.obs_dim = task, subtask, settings, obs_dim
        self.geometry = features if settings.features else None
        relative = RelativeFeatures(self.geometry) if self.geometry is not None else None
        self.normalizer = Normalizer(obs_dim)
        shared: dict[str, Any] = {
            "obs_dim": obs_dim,
            "hidden": settings.hidden,
            "activation": ACTIVATIONS[settings.activation],
            "normalizer": self.normalizer,
            "features": relative,
        }
        std = torch.tensor([settings.action_std] * 7 + [settings.hand_std] * 2)
        self.policy = make_policy(std=settings.std, action_std=std, **shared)
        self.value = make_value(**shared)
        hidden, activation = (
            settings.discriminator_hidden,
            ACTIVATIONS[settings.discriminator_activation],
        )
        self.f_phi, self.d_omega = (
            make_discriminator(obs_dim, hidden=hidden, activation=activation, normalizer=self.normalizer)
            for _ in range(2)
        )
        self.return_scale = ReturnScale()
        self.initiation_set, self.termination_set = (
            InitiationSet(capacity),
            TerminationSet(capacity),
        )

    def to(self, device: torch.device | str) -> "Skill":
        """Moves networks and sets; returns the skill."""
        for module in self.modules.values():
            module.to(device)
        for name, kind in (("initiation_set", InitiationSet), ("termination_set", TerminationSet)):
            moved, state = kind(getattr(self, name).capacity, device), getattr(self, name).state_dict()
            moved.load_state_dict(state)
            setattr(self, name, moved)
        return self

    @property
    def modules(self) -> dict[str, nn.Module]:
        """The networks by name, with their normaliser inside."""
        names = ("policy", "value", "f_phi", "d_omega", "return_scale")
        return {name: getattr(self, name) for name in names}

    def network_state(self) -> dict[str, Any]:
        """Copies of all parameters and buffers."""
        return {
            name: {key: value.clone() for key, value in module.state_dict().items()}
            for name, module in self.modules.items()
        }

    def load_network_state(self, state: dict[str, Any]) -> None:
        """What `network_state` gave."""
        for name, module in self.modules.items():
            module.load_state_dict(state[name])

    def state_dict(self) -> dict[str, Any]:
        """Networks and sets."""
        sets = {name: getattr(self, name).state_dict() for name in ("initiation_set", "termination_set")}
        return {**self.network_state(), **sets}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """What `state_dict` gave."""
        self.load_network_state(state)
        self.initiation_set.load_state_dict(state["initiation_set"])
        self.termination_set.load_state_dict(state["termination_set"])

    def save(self, path: str | Path, **record: Any) -> None:
        """Writes the skill, and beside it plain values that say what it is."""
        built = {"settings": asdict(self.settings), "geometry": checkpoint.to_plain(self.geometry)}
        built |= {"capacity": self.initiation_set.capacity, "obs_dim": self.obs_dim}
        record = {"task": self.task, "subtask": self.subtask, "built": built, **record}
        checkpoint.save(path, {"skill": self}, record)

    @classmethod
    def load(cls, path: str | Path, **expected: Any) -> "Skill":
        """Builds the skill saved at `path`.

        Raises:
            FileNotFoundError: if there is none.
            CheckpointMismatchError: if what is `expected` (task=..., subtask=...) is not what it was saved with.
        """
        record = checkpoint.read_record(path, **expected)
        built = record["built"]
        skill = cls(
            record["task"],
            record["subtask"],
            NetworkSettings(**checkpoint.to_tuples(built["settings"])),
            checkpoint.to_tensors(built["geometry"]),
            built["capacity"],
            built.get("obs_dim", FIVE_PARTS),
        )
        checkpoint.load(path, {"skill": skill}, **expected)
        return skill
