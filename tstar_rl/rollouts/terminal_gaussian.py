"""The Gaussian that Policy Sequencing fits to a termination set."""

from collections.abc import Mapping
from typing import Protocol

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from tstar_rl.rollouts.state_sets import TerminationSet

__all__ = ["TerminalGaussian"]


class _Posable(Protocol):
    """What `TerminalGaussian` asks of an environment."""

    def qpos_of(self, snapshot: TensorDictBase) -> Tensor: ...

    def one_sided(self, qpos: Tensor) -> Tensor: ...

    def with_qpos(self, snapshot: TensorDictBase, qpos: Tensor) -> tuple[TensorDictBase, Tensor]: ...


class TerminalGaussian:
    """A Gaussian over the positions (qpos) of a termination set, as a source of starts.

    A draw takes a random member's snapshot for what is not a position (welds, task state) and puts the drawn
    positions into it. The environment normalises quaternions and refuses impossible draws, which are drawn again; a
    row still refused after `tries` is the member itself. It is fitted anew whenever the set has changed.

    Args:
        env: with `qpos_of`, `one_sided` and `with_qpos`.
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
        snapshots = self.termination_set.buffer[:]["snapshot"]  # only read, so no copy as all() makes
        qpos = self.env.one_sided(self.env.qpos_of(snapshots).double())
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

    def state_dict(self) -> dict[str, int]:
        """What it has counted: the Gaussian itself is that of the termination set."""
        return dict(self.counts)

    def load_state_dict(self, state: Mapping[str, int]) -> None:
        """What `state_dict` gave."""
        self.counts = {name: int(state[name]) for name in self.counts}
