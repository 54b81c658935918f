"""Starts episodes where the skill before has ended."""

from typing import Any, Protocol, cast

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Binary, Composite, TensorSpec
from torchrl.envs import ParallelEnv, SerialEnv, Transform, TransformedEnv

from tstar_rl.checks import InvalidValueError


class Starts(Protocol):
    """Where starts are drawn from: a `TerminationSet`, a `TerminalGaussian`, anything like them."""

    def sample(self, n: int, generator: torch.Generator) -> TensorDictBase:
        """Snapshots, or rows with a "snapshot" entry, batch size [n]; [0] if there are none yet."""
        ...


def sample(starts: Starts, n: int, generator: torch.Generator) -> TensorDictBase:
    """n starts of a source, batch size [n]; [0] while it has none.

    Raises:
        InvalidValueError: if it gives another number of them.
    """
    drawn = starts.sample(n, generator)
    if drawn.batch_size[0] not in (0, n):
        raise InvalidValueError(
            f"{type(starts).__name__}.sample({n}) gave {drawn.batch_size[0]} starts: it must give as many as it is "
            "asked for, or none while it has none"
        )
    return drawn


class SkillChainReset(Transform):
    """At a reset, puts a share of the simulations into states drawn from `starts`.

    The environment finds them at ("start", "snapshot") with ("start", "use") (*batch, 1), in what its `_reset`
    is given; where `use` is False, and while `starts` is empty, it draws s_0 itself. Every row of an episode says which
    it was: "start_chained" (*batch, 1) bool. Whether the environment reads them is not asked: one that does not begins
    in s_0 where a row says that it was chained.

    Args:
        starts: read by handle, at every reset, so it may grow meanwhile.
        probability: of a start from `starts`.
        seed: of the transform's own generator, which is part of its state and which `env.set_seed` does not reach:
            each of several workers needs another, or all draw the same. TorchRL's `EnvCreator` loads one environment's
            state into those of all workers, and with it this generator: give workers a function, not an `EnvCreator`.
        goes_on: whether the episodes that the snapshots were taken in go on; by default new ones begin there, whose
            "completed" counts from 0, also where some subtasks are done in the snapshot.

    Raises:
        ValueError: if the probability is not in [0, 1]; at a reset, if it is around a `ParallelEnv`, or around
            environments with transforms of their own that TorchRL has not made one with it, or beside another one, or
            if `starts` gives another number of them than it was asked for.
        KeyError: at a step without "start_chained".

    A clone shares generator and counts with it, as clones of TorchRL's transforms share what is no parameter; so an
    environment for evaluation needs one of its own.

    Source: the paper, algorithm 1 line 11; 80% and 20% from its appendix C.
    """

    def __init__(
        self, starts: Starts, probability: float = 0.8, seed: int = 0, goes_on: bool = False
    ) -> None:
        if not 0.0 <= probability <= 1.0:
            raise ValueError(f"probability must be in [0, 1], got {probability}")
        super().__init__(in_keys=[], out_keys=["start_chained"])
        self.starts = starts
        self.probability = probability
        self.goes_on = goes_on
        self.generator = torch.Generator().manual_seed(seed)
        self.draws = {"environment": 0, "chained": 0}
        self._chained = torch.zeros(0, 1, dtype=torch.bool)

    def _reset_env_preprocess(self, tensordict: TensorDictBase | None) -> TensorDictBase:
        if tensordict is None:
            assert self.parent is not None, "SkillChainReset acts in an environment"
            tensordict = TensorDict(batch_size=self.parent.batch_size, device=self.parent.device)
        reset = tensordict.get("_reset", None)
        batch = tensordict.batch_size
        rows = torch.ones(batch.numel(), dtype=torch.bool) if reset is None else reset.reshape(-1).cpu()
        start = self._draw(rows)
        self._chained = torch.zeros(*batch, 1, dtype=torch.bool)
        if start is not None:
            tensordict.set("start", start.reshape(batch).to(tensordict.device))
            self._chained = start["use"].reshape(*batch, 1)
        return tensordict

    def _check_place(self) -> None:
        """Raises InvalidValueError beside another, and around an environment that drops the starts."""
        around = getattr(self.container, "transform", self)  # self.parent has those before this one alone
        if sum(isinstance(each, SkillChainReset) for each in around.modules()) > 1:
            raise InvalidValueError(
                "an environment has two SkillChainReset: one would choose the state and the other say whether it was "
                "chained. One of them can draw from several sources: SkillChainReset(MixedStarts([...], shares), ...)"
            )
        env = getattr(self.parent, "base_env", None)
        inside = getattr(env, "_envs", None) or [] if isinstance(env, SerialEnv) else [env]
        if isinstance(env, ParallelEnv) or any(isinstance(one, TransformedEnv) for one in inside):
            around = "ParallelEnv" if isinstance(env, ParallelEnv) else "TransformedEnv"
            raise InvalidValueError(
                f"SkillChainReset does not act around a {around}, which hands only declared entries on: append it to "
                "the environment that each worker makes, each with a seed of its own. A worker's copy of `starts` does "
                "not grow with yours; collection.backend=ray keeps them together"
            )

    def _reset(self, tensordict: TensorDictBase, tensordict_reset: TensorDictBase) -> TensorDictBase:
        self._check_place()
        # Rows that are not being reset get back their own entry from TorchRL afterwards.
        return tensordict_reset.set("start_chained", self._chained.to(tensordict_reset.device))

    def _step(self, tensordict: TensorDictBase, next_tensordict: TensorDictBase) -> TensorDictBase:
        chained = tensordict.get("start_chained", None)
        if chained is None:
            raise KeyError("SkillChainReset: the step has no 'start_chained'; begin with env.reset()")
        return next_tensordict.set("start_chained", chained.clone())

    def transform_observation_spec(self, observation_spec: TensorSpec) -> TensorSpec:
        """Adds "start_chained"."""
        observation_spec = cast(Composite, observation_spec)
        shape = torch.Size((*observation_spec.shape, 1))
        flag = Binary(1, shape, dtype=torch.bool, device=observation_spec.device)
        observation_spec["start_chained"] = flag
        return observation_spec

    def _draw(self, rows: Tensor) -> TensorDictBase | None:
        """rows: (n,) bool, those being reset -> {"snapshot", "use"} of batch size [n], or None if none is chained."""
        use = rows.clone()
        use[rows] = torch.rand(int(rows.sum()), generator=self.generator) < self.probability
        count = int(use.sum())
        drawn = sample(self.starts, count, self.generator) if count else None
        if drawn is None or drawn.batch_size[0] == 0:
            self.draws["environment"] += int(rows.sum())
            return None
        self.draws["chained"] += count
        self.draws["environment"] += int(rows.sum()) - count
        drawn = drawn.get("snapshot", drawn)
        row_of = (use.cumsum(0) - 1).clamp_min(0)  # rows that do not use theirs get a copy of another's
        start = {"snapshot": drawn[row_of.to(drawn.device)], "use": use.unsqueeze(-1)}
        if self.goes_on:
            start["goes_on"] = start["use"]
        return TensorDict(start, [len(rows)])

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Not supported.

        Raises:
            NotImplementedError: always.
        """
        raise NotImplementedError(
            "SkillChainReset acts on resets: append it to an environment, not to a replay buffer, a postproc or a model"
        )

    def get_extra_state(self) -> dict[str, Any]:
        """The generator's state and the counts, as tensors."""
        counts = {name: torch.tensor(count) for name, count in self.draws.items()}
        return {"generator": self.generator.get_state(), **counts}

    def set_extra_state(self, state: dict[str, Any]) -> None:
        """What `get_extra_state` gave."""
        self.generator.set_state(state["generator"].cpu())
        self.draws = {name: int(state[name]) for name in self.draws}
