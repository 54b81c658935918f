"""Initiation and termination sets, and the Gaussian that Policy Sequencing fits to a termination set.

A set is a ring on TorchRL's replay buffer: the newest `capacity` states. Rows are drawn uniformly, with
replacement, with a generator that the caller owns, so that a run can be resumed to the bit.
"""

from collections.abc import Mapping
from typing import Any, Protocol

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer

__all__ = ["InitiationSet", "StateSet", "TerminalGaussian", "TerminationSet"]


class StateSet:
    """A ring of states.

    Args:
        capacity: states kept; the oldest go first.
        device: where they are kept.

    Raises:
        ValueError: if the capacity is not positive.
    """

    def __init__(self, capacity: int = 10_000, device: torch.device | str = "cpu") -> None:
        if capacity < 1:
            raise ValueError(f"capacity must be at least 1, got {capacity}")
        self.capacity, self.device = capacity, torch.device(device)
        self.changes = 0
        """How often the set has changed since it was made; whoever derives something from it can tell."""
        self.clear()

    def clear(self) -> None:
        """Removes all states, in place: whoever holds the set sees it empty."""
        storage = LazyTensorStorage(self.capacity, device=self.device)
        self.buffer = TensorDictReplayBuffer(storage=storage, batch_size=1)
        self.added = 0
        self.changes += 1

    def to(self, device: torch.device | str) -> "StateSet":
        """Moves the states to a device, in place; returns the set."""
        state = self.state_dict()
        self.device = torch.device(device)
        self.load_state_dict(state)
        return self

    def __len__(self) -> int:
        return len(self.buffer)

    def extend(self, rows: TensorDictBase) -> int:
        """Adds rows (n,); of more than `capacity` the last are kept. Returns n."""
        count = rows.batch_size[0]
        if count:
            self.buffer.extend(rows[-self.capacity :].clone().to(self.device))
            self.added += count
            self.changes += 1
        return count

    def all(self) -> TensorDictBase:
        """Every state, batch size [len(self)], in the order of the ring's slots."""
        return self.buffer[:].clone() if len(self) else TensorDict(batch_size=[0])

    def observations(self) -> Tensor:
        """The observations of all states, (n, O); (0, 1) from an empty set, which does not know O."""
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
            "added": self.added,
            "writer": self.buffer.writer.state_dict(),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """What `state_dict` gave.

        Raises:
            ValueError: if there are more rows than this set's capacity.
        """
        count = int(state["count"])
        if count > self.capacity:
            raise ValueError(f"the saved set has {count} states, but this one's capacity is {self.capacity}")
        self.clear()
        if count:
            self.buffer.extend(TensorDict(state["rows"], batch_size=[count], device=self.device))
        self.buffer.writer.load_state_dict(dict(state["writer"]))
        self.added = int(state["added"])


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

    Source: the paper, algorithm 1 line 12.
    """

    def extend_from(self, rollout: TensorDictBase) -> int:
        """Adds s_0 of every success in a rollout with `EpisodeStart`'s entry; returns how many."""
        rows = _successes(rollout, "start_observation")
        return self.extend(TensorDict({"observation": rows["start_observation"]}, rows.batch_size))


class TerminationSet(StateSet):
    """beta_i: the states in which a skill has succeeded, where the next begins. Rows: "observation", "snapshot".

    Source: the paper, algorithm 1 line 12.
    """

    def extend_from(self, rollout: TensorDictBase) -> int:
        """Adds s_T of every success in a rollout of an environment with snapshots=True; returns how many."""
        rows = _successes(rollout, ("next", "observation"), ("next", "snapshot"))
        return self.extend(rows.get("next").select("observation", "snapshot"))


class _Posable(Protocol):
    """What `TerminalGaussian` asks of an environment."""

    def qpos_of(self, snapshot: TensorDictBase) -> Tensor: ...

    def with_qpos(self, snapshot: TensorDictBase, qpos: Tensor) -> tuple[TensorDictBase, Tensor]: ...


class TerminalGaussian:
    """A Gaussian over the positions (qpos) of a termination set, as a source of starts.

    A draw takes a random member's snapshot for what is not a position (welds, task state) and puts the drawn
    positions into it. The environment normalises quaternions and refuses impossible draws, which are drawn again; a
    row still refused after `tries` is the member itself. It is fitted anew whenever the set has changed.

    Args:
        env: with `qpos_of` and `with_qpos`.
        termination_set: of the skill before.
        tries: draws for one row at most.

    Source: the paper's appendix C (Policy Sequencing, Clegg et al. 2018).
    """

    def __init__(self, env: _Posable, termination_set: TerminationSet, tries: int = 10) -> None:
        if tries < 1:
            raise ValueError(f"tries must be at least 1, got {tries}")
        self.env = env
        self.termination_set = termination_set
        self.tries = tries
        self.counts = {"drawn": 0, "refused": 0, "given_up": 0}
        self._fitted_at = -1

    def fit(self) -> None:
        """Sets mean (nq,) and factor (nq, nq), with factor @ factor.T the covariance of the set's positions."""
        qpos = self.env.qpos_of(self.termination_set.all()["snapshot"]).double()
        self.mean = qpos.mean(0)
        deviation = qpos - self.mean
        covariance = deviation.T @ deviation / max(len(qpos) - 1, 1)
        values, vectors = torch.linalg.eigh(covariance)
        self.factor = vectors * values.clamp_min(0.0).sqrt()
        self._fitted_at = self.termination_set.changes

    def sample(self, n: int, generator: torch.Generator) -> TensorDictBase:
        """n snapshots, batch size [n]; [0] while the termination set is empty."""
        if not len(self.termination_set):
            return TensorDict(batch_size=[0])
        if self._fitted_at != self.termination_set.changes:
            self.fit()
        snapshot = self.termination_set.sample(n, generator)["snapshot"].clone()
        waiting = torch.arange(n)
        for _ in range(self.tries):
            if not len(waiting):
                break
            noise = torch.randn(len(waiting), len(self.mean), dtype=torch.float64, generator=generator)
            qpos = self.mean + noise.to(self.mean.device) @ self.factor.T
            posed, possible = self.env.with_qpos(snapshot[waiting], qpos)
            possible = possible.to(waiting.device)
            snapshot[waiting[possible]] = posed[possible]
            self.counts["drawn"] += len(waiting)
            waiting = waiting[~possible]
            self.counts["refused"] += len(waiting)
        self.counts["given_up"] += len(waiting)
        return snapshot
