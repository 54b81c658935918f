"""Rollouts by workers of a Ray cluster, with the interface of `collection.Collection`.

TorchRL's `RayCollector` places and makes the workers. What a worker reads that changes in training (the policy with its
normaliser and deviation, the set of the states in which the skill before ended) is not left with it: every rollout is
asked for with all of it, so that Ray may ask another worker. A set that a recipe itself gives for starts is sent once,
with the environment: it stays as it was then. One that dies is replaced, and its rollout begun again, by Ray itself.
"""

import logging
from collections.abc import Callable, Mapping
from copy import deepcopy
from functools import partial
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import nn
from torchrl.collectors import Collector
from torchrl.envs import TransformedEnv

from tstar_rl.rollouts.cluster import RETRIES, ClusterSettings, connect, resources
from tstar_rl.rollouts.collection import COLLECTOR, counts_of, load_state, state_of
from tstar_rl.rollouts.starts import termination_sets
from tstar_rl.rollouts.state_sets import TerminationSet
from tstar_rl.seeds import derive_seed

__all__ = ["RayCollection", "Worker"]


class Worker(Collector):
    """What runs in a Ray worker: a share of the simulations."""

    @torch.no_grad()
    def collect(
        self, policy: Mapping[str, torch.Tensor], starts: Mapping[str, Any] | None, seed: int
    ) -> TensorDictBase:
        """A rollout (N, T), on the CPU, of a policy and from starts given as their states; the seed is the actions'."""
        self.policy.load_state_dict(policy)
        if starts is not None:
            for termination_set in termination_sets(self.env):
                termination_set.load_state_dict(starts)
        torch.manual_seed(seed)
        return self.rollout().cpu().clear_device_()

    def settle(self) -> None:
        """See `Collection.settle`."""
        load_state(self, state_of(self))

    def simulations(self) -> dict[str, Any]:
        """See `Collection.state_dict`."""
        return state_of(self)

    def load_simulations(self, state: dict[str, Any]) -> None:
        """What `simulations` gave."""
        load_state(self, state)

    def counts(self) -> dict[str, int]:
        """See `counts_of`."""
        return counts_of(self.env)


def _make(
    make: Callable[..., TransformedEnv], num_envs: int, seed: int, capacity: int | None, starts: Any
) -> TransformedEnv:  # fmt: skip
    """A worker's environment, whose first starts are of a set's state; each rollout brings the set as it is then."""
    torch.set_num_threads(1)
    logging.getLogger("torchrl").setLevel(logging.WARNING)
    if capacity is None:
        return make(num_envs, seed, None)
    before = TerminationSet(capacity)
    before.load_state_dict(starts)
    return make(num_envs, seed, before)


class RayCollection:
    """Rollouts of a policy by workers that share the simulations out among them.

    The same seed and number of workers give the same rollouts, and a run that is resumed goes on bit for bit, as long
    as no worker dies: one that takes the place of another begins new episodes.

    Args:
        make: num_envs, seed, termination set or None -> an environment; it is sent to the workers.
        policy: reads and writes TensorDicts. Its state is sent with every rollout.
        num_envs: simulations N, of all workers together.
        horizon: steps T of each simulation in one rollout.
        workers: how many; each has N / workers simulations.
        seed: of the workers' environments and actions.
        before: the termination set of the skill before, if starts are drawn from it.
        settings: of the cluster.

    Raises:
        ValueError: if the simulations cannot be shared out evenly.
        ImportError: if Ray is not installed.
    """

    def __init__(
        self, make: Callable[..., TransformedEnv], policy: nn.Module, num_envs: int, horizon: int, workers: int,
        seed: int, before: TerminationSet | None = None, settings: ClusterSettings | None = None,
    ) -> None:  # fmt: skip
        if workers < 1 or num_envs % workers:
            raise ValueError(
                f"training.num_envs must be a multiple of collection.workers, got {num_envs} simulations for {workers}"
            )
        settings = settings or ClusterSettings()
        self.ray = connect(settings, workers)
        from torchrl.collectors.distributed import RayCollector

        self.policy, self.before, self.seed, self.rollouts = policy, before, seed, 0
        self.device = next(policy.parameters()).device
        share = num_envs // workers
        starts = (None, None) if before is None else (before.capacity, before.state_dict())
        seeds = [derive_seed(seed, "train", index) for index in range(workers)]
        self.collector = RayCollector(
            [partial(_make, make, share, one, *starts) for one in seeds],
            deepcopy(policy),
            collector_class=Worker,
            collector_kwargs={name: COLLECTOR[name] for name in COLLECTOR if name != "total_frames"},
            frames_per_batch=num_envs * horizon,
            sync=True,
            weight_sync_schemes={},  # they know no replaced workers; `collect` brings the weights
            remote_configs={**resources(settings), "max_restarts": RETRIES, "max_task_retries": -1},
        )

    def rollout(self) -> TensorDictBase:
        """The next rollout, batch [N, T], the workers' simulations one after another."""
        policy = {name: value.detach().cpu() for name, value in self.policy.state_dict().items()}
        weights = self.ray.put(policy)
        starts = self.ray.put(None if self.before is None else self.before.state_dict())
        workers = self.collector.remote_collectors
        seeds = [derive_seed(self.seed, "collect", self.rollouts, index) for index in range(len(workers))]
        pieces = [
            worker.collect.remote(weights, starts, seed) for worker, seed in zip(workers, seeds, strict=True)
        ]
        self.rollouts += 1
        together: TensorDictBase = torch.cat(self.ray.get(pieces))  # pyright: ignore[reportAssignmentType]
        return together.to(self.device)

    def settle(self) -> None:
        """Each worker loads its own state; see `Collection.settle`."""
        self._ask("settle")

    def counts(self) -> dict[str, int]:
        """Of all workers' environments together; see `counts_of`."""
        counts = self._ask("counts")
        names = dict.fromkeys(name for each in counts for name in each)
        return {name: sum(each.get(name, 0) for each in counts) for name in names}

    def state_dict(self) -> dict[str, Any]:
        """The state of every worker, and which rollout is next."""
        states = self._ask("simulations")
        return {"rollouts": self.rollouts, **{f"worker{i}": state for i, state in enumerate(states)}}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """What `state_dict` gave, for the same number of workers."""
        self.rollouts = int(state["rollouts"])
        states = [state[f"worker{i}"] for i in range(len(self.collector.remote_collectors))]
        self._ask("load_simulations", *states)

    def close(self) -> None:
        """Ends the workers; the cluster stays."""
        self.collector.shutdown()

    def _ask(self, name: str, *arguments: Any) -> list[Any]:
        """A method of every worker, with one argument each if there are any."""
        workers = self.collector.remote_collectors
        each = [(one,) for one in arguments] or [()] * len(workers)
        calls = [getattr(worker, name).remote(*one) for worker, one in zip(workers, each, strict=True)]
        return self.ray.get(calls)
