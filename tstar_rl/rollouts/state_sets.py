"""Initiation and termination sets: rings on TorchRL's replay buffer that keep the newest `capacity` states.

Rows are drawn with replacement, uniformly unless a termination set has been given weights, with a generator that the
caller owns, so that a run can be resumed to the bit.
"""

import logging
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer

from tstar_rl.checks import InvalidValueError

__all__ = ["InitiationSet", "StateSet", "TerminationSet"]


@contextmanager
def _without_notes() -> Iterator[None]:
    """Keeps back what TorchRL notes of every storage that is filled for the first time: a chain has several a skill."""
    logger = logging.getLogger("torchrl")
    level = logger.level
    logger.setLevel(logging.WARNING)
    try:
        yield
    finally:
        logger.setLevel(level)


class StateSet:
    """A ring of states.

    Args:
        capacity: states kept; the oldest go first.

    Raises:
        ValueError: if the capacity is not positive.
    """

    def __init__(self, capacity: int = 10_000) -> None:
        if capacity < 1:
            raise ValueError(f"capacity must be at least 1, got {capacity}")
        self.capacity, self.device = capacity, torch.device("cpu")
        self.changes = 0
        """How often the set has changed since it was made; whoever derives something from it can tell."""
        self.clear()

    def clear(self) -> None:
        """Removes all states, in place: whoever holds the set sees it empty."""
        storage = LazyTensorStorage(self.capacity, device=self.device)
        self.buffer = TensorDictReplayBuffer(storage=storage, batch_size=1)
        self.changes += 1

    def to(self, device: torch.device | str) -> "StateSet":
        """Moves the states to a device, in place; returns the set."""
        state = self.state_dict()
        self.device = torch.device(device)
        self.load_state_dict(state)
        return self

    def __getstate__(self) -> dict[str, Any]:
        """What a copy, or another process, begins with: TorchRL's buffer itself cannot be handed on."""
        return {**self.__dict__, "buffer": self.state_dict()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self.clear()
        self.load_state_dict(state["buffer"])
        self.changes = state["changes"]

    def __len__(self) -> int:
        return len(self.buffer)

    def extend(self, rows: TensorDictBase) -> int:
        """Adds rows (n,); of more than `capacity` the last are kept. Returns n.

        Raises:
            InvalidValueError: if they have other entries than those that are there, which would be read as noise, or an
                entry of another size, which would be repeated to fit.
        """
        count = rows.batch_size[0]
        if count:
            self._check_entries(rows)
            with _without_notes():
                self.buffer.extend(rows[-self.capacity :].clone().to(self.device))
            self.changes += 1
        return count

    def _check_entries(self, rows: TensorDictBase) -> None:
        if not len(self):
            return
        kept = self.buffer[:1]
        there, new = (set(each.keys(True, leaves_only=True)) - {"index"} for each in (kept, rows))
        if wrong := sorted(there ^ new, key=str):
            which = "lack" if wrong[0] in there else "have"
            raise InvalidValueError(
                f"states must have the entries of those in the set; these {which} {wrong[0]}"
            )
        for key in sorted(new, key=str):
            if (size := rows[key].shape[1:]) != (others := kept[key].shape[1:]):
                raise InvalidValueError(
                    f"states must have the sizes of those in the set, {key} {tuple(others)}; got {tuple(size)}"
                )

    def all(self) -> TensorDictBase:
        """Every state, batch size [len(self)], in the order of the ring's slots."""
        return self.buffer[:].clone() if len(self) else TensorDict(batch_size=[0])

    def observations(self) -> Tensor:
        """The observations of all states, (n, O), as they lie there: clone what is to stay when the set grows.

        (0, 1) from an empty set, which does not know O.
        """
        return self.buffer[:]["observation"] if len(self) else torch.zeros(0, 1, device=self.device)

    def sample(self, n: int, generator: torch.Generator) -> TensorDictBase:
        """n states drawn uniformly with replacement, batch size [n]; [0] from an empty set."""
        if not len(self):
            return TensorDict(batch_size=[0])
        return self.buffer[torch.randint(len(self), (n,), generator=generator)]

    def state_dict(self) -> dict[str, Any]:
        """The rows as nested dicts of tensors, and where the ring stands."""
        count = len(self)
        return {
            "rows": self.all().to_dict() if count else {},
            "count": count,
            "writer": self.buffer.writer.state_dict(),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """What `state_dict` gave, also of a set of another capacity: a smaller one's states are taken oldest first.

        Raises:
            ValueError: if there are more rows than this set's capacity.
        """
        count, cursor = int(state["count"]), int(state["writer"]["_cursor"])
        if count > self.capacity:
            raise ValueError(f"the saved set has {count} states, but this one's capacity is {self.capacity}")
        self.clear()
        full = count == self.capacity
        if count:
            rows = TensorDict(state["rows"], batch_size=[count], device=self.device)
            oldest_first = torch.arange(count).roll(-cursor)
            with _without_notes():
                self.buffer.extend(rows if full else rows[oldest_first])
        if full:  # every row is in its slot, and the ring goes on where it stood
            self.buffer.writer.load_state_dict(dict(state["writer"]))


def _dotted(key: Any) -> str:
    return key if isinstance(key, str) else ".".join(key)


def _successes(rollout: TensorDictBase, *keys: Any) -> TensorDictBase:
    """The rows of a rollout of any shape that ended in success, with a KeyError for what a set needs."""
    for key in (("next", "success"), *keys):
        if rollout.get(key, None) is None:
            there = ", ".join(sorted(_dotted(key) for key in rollout.keys(True)))
            raise KeyError(f"the rollout has no {_dotted(key)}; it has {there}")
    return rollout.select(("next", "success"), *keys)[rollout["next", "success"].squeeze(-1)]


class InitiationSet(StateSet):
    """I_i: the states from which a skill has succeeded. Rows: "observation".

    Source: the paper, algorithm 1 line 14.
    """

    def extend_from(self, rollout: TensorDictBase) -> int:
        """Adds s_0 of every success in a rollout with `EpisodeStart`'s entry; returns how many."""
        rows = _successes(rollout, "start_observation")
        return self.extend(TensorDict({"observation": rows["start_observation"]}, rows.batch_size))


class TerminationSet(StateSet):
    """beta_i: the states in which a skill has succeeded, where the next begins. Rows: "observation", "snapshot".

    Source: the paper, algorithm 1 line 14.
    """

    _weights, _weighed_at = torch.empty(0), -1

    def weigh(self, weights: Tensor | None) -> None:
        """Draws states by these weights until the set changes, is loaded or moved. They are no part of its state.

        Args:
            weights: (len(self),), in the order of `all()`; not negative, with a positive, finite sum. None: alike
                again.

        Raises:
            ValueError: if there is not one such weight for each state.
        """
        if weights is None:
            self._weighed_at = -1
            return
        fit = weights.shape == (len(self),) and bool((weights >= 0).all())
        fit = fit and 0 < float(weights.sum()) < math.inf
        if not fit:
            raise ValueError(
                f"a set of {len(self)} states needs as many weights, none negative and not all 0; "
                f"got shape {tuple(weights.shape)}, sum {float(weights.sum())}"
            )
        self._weights, self._weighed_at = weights.cpu().double(), self.changes

    def sample(self, n: int, generator: torch.Generator) -> TensorDictBase:
        """n states drawn with replacement, by their weights if they have been weighed; [0] from an empty set."""
        if self._weighed_at != self.changes:
            return super().sample(n, generator)
        return self.buffer[torch.multinomial(self._weights, n, replacement=True, generator=generator)]

    def extend_from(self, rollout: TensorDictBase) -> int:
        """Adds s_T of every success in a rollout of an environment with snapshots=True; returns how many."""
        rows = _successes(rollout, ("next", "observation"), ("next", "snapshot"))
        return self.extend(rows.get("next").select("observation", "snapshot"))
