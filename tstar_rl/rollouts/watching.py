"""Episodes recorded step by step, to be played in a browser; see `FurnitureEnv.write_player`."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.envs import ExplorationType, TransformedEnv, set_exploration_type

from tstar_rl.checks import InvalidValueError
from tstar_rl.rollouts.episodes import run_episodes

__all__ = ["EpisodeLog", "StepSignal", "d_omega_signal", "log_episodes", "record_episode", "rows_to_show"]

StepSignal = Callable[[TensorDictBase], Tensor]
"""From the TensorDict of a step, batch [n], to (n,): a number worth showing, NaN where there is none."""

_EACH_STATE = ("subtask", "phase")
_EACH_STEP = ("reward_env", "success", "done")


class EpisodeLog:
    """Remembers one episode of each simulation; to be called with every step of `run_episodes`.

    Args:
        env: with `qpos_of`, and snapshots=True.
        number: how many simulations are recorded, from the first on; None: all. That takes about 4 nq bytes a step of
            each.
        signals: what else to remember of each step, by name.
        enough: subtasks after which an episode has succeeded and is over; None: the environment says when.
    """

    def __init__(
        self,
        env: Any,
        number: int | None = None,
        signals: Mapping[str, StepSignal] | None = None,
        enough: int | None = None,
    ) -> None:
        self.env, self.number, self.signals, self.enough = env, number, dict(signals or {}), enough
        self._states: dict[str, list[Tensor]] = {name: [] for name in ("positions", *_EACH_STATE)}
        self._steps: dict[str, list[Tensor]] = {name: [] for name in (*_EACH_STEP, *self.signals)}

    def __call__(self, tensordict: TensorDictBase) -> None:
        """Takes the step's TensorDict, batch [N]."""
        step = tensordict[: self.number]
        if not self._states["positions"]:
            self._take_state(step)
        following: TensorDictBase = step["next"]
        self._take_state(following)
        for name in _EACH_STEP:
            self._steps[name].append(_kept(following[name].squeeze(-1)))
        if self.enough is not None:
            over = _kept(following["completed"].squeeze(-1) >= self.enough)
            for name in ("success", "done"):
                self._steps[name][-1] |= over
        for name, signal in self.signals.items():
            self._steps[name].append(_kept(signal(step)))

    def __len__(self) -> int:
        """Steps taken."""
        return len(self._steps["done"])

    def lengths(self) -> Tensor:
        """(n,): steps of each simulation's first episode, up to and with the one that ended it."""
        done = torch.stack(self._steps["done"])
        return torch.where(done.any(0), done.int().argmax(0) + 1, len(done))

    def successes(self) -> Tensor:
        """(n,) bool: whether each simulation's first episode ended in success."""
        success, lengths = torch.stack(self._steps["success"]), self.lengths()
        return success[lengths - 1, torch.arange(len(lengths))]

    def last_done(self, row: int) -> int:
        """The step of simulation `row`'s first episode after which its subtask last changed; 0: it never did."""
        changed = self._of("subtask", row, int(self.lengths()[row]) + 1).diff().nonzero()
        return int(changed.max()) + 1 if len(changed) else 0

    def positions(self, row: int) -> Tensor:
        """(T + 1, nq): joint positions of simulation `row` in its first episode, from before the first step on."""
        return self._of("positions", row, int(self.lengths()[row]) + 1)

    def episode(self, row: int, title: str) -> dict[str, Any]:
        """The first episode of simulation `row`, as `FurnitureEnv.write_player` takes it."""
        steps = int(self.lengths()[row])
        return {
            "title": title,
            "positions": self._of("positions", row, steps + 1).numpy(),
            "subtask": self._of("subtask", row, steps + 1).numpy(),
            "phase": self._of("phase", row, steps + 1).numpy(),
            "reward": self._of("reward_env", row, steps).numpy(),
            "success": bool(self.successes()[row]),
            "series": {name: self._of(name, row, steps).numpy() for name in self.signals},
        }

    def _take_state(self, tensordict: TensorDictBase) -> None:
        positions = self.env.qpos_of(tensordict["snapshot"])
        self._states["positions"].append(positions.to("cpu", torch.float32, copy=True))
        for name in _EACH_STATE:
            self._states[name].append(_kept(tensordict[name].squeeze(-1)))

    def _of(self, name: str, row: int, length: int) -> Tensor:
        kept = self._states[name] if name in self._states else self._steps[name]
        return torch.stack([values[row] for values in kept[:length]])


def d_omega_signal(following: Sequence[Callable[[Tensor], Tensor]]) -> StepSignal:
    """What d_omega of the next skill says of the state in which a subtask was done, clipped as in its reward.

    Args:
        following: d_omega of the skills of subtasks 1, 2, ..., raw, (n, O) -> (n, 1).

    Source: the paper, eq. 2.
    """

    @torch.no_grad()
    def signal(step: TensorDictBase) -> Tensor:
        observation = step["next", "observation"]
        said = torch.full(observation.shape[:-1], torch.nan, device=observation.device)
        before, after = step["subtask"].squeeze(-1), step["next", "subtask"].squeeze(-1)
        for index, d_omega in enumerate(following, start=1):
            reached = (before == index - 1) & (after == index)
            if reached.any():
                said[reached] = d_omega(observation[reached]).squeeze(-1).clamp(0.0, 1.0)
        return said

    return signal


def log_episodes(
    env: TransformedEnv,
    policy: Callable[[TensorDictBase], TensorDictBase],
    number: int | None = None,
    signals: Mapping[str, StepSignal] | None = None,
    enough: int | None = None,
) -> EpisodeLog:
    """Runs a deterministic episode of every simulation of `env`, from `with_starts` and with snapshots=True.

    Args:
        env: batch [N].
        policy: any: reads and writes TensorDicts of batch [N].
        number: see `EpisodeLog`.
        signals: what else to show of each step, by name.
        enough: subtasks of a chain that is shorter than the task, after which an episode has succeeded; None: all.

    Raises:
        InvalidValueError: if the environment has no step count or no snapshots.
    """
    if not {"snapshot", "step_count"} <= {*env.observation_spec.keys()}:
        raise InvalidValueError(
            "episodes are recorded of with_starts(FurnitureEnv(..., snapshots=True)): this environment has no "
            "snapshots or no step count"
        )
    log = EpisodeLog(env.base_env, number, signals, enough)
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        run_episodes(env, policy, log, enough)
    return log


def record_episode(
    env: TransformedEnv,
    policy: Callable[[TensorDictBase], TensorDictBase],
    title: str,
    success: bool | None = None,
    signals: Mapping[str, StepSignal] | None = None,
    enough: int | None = None,
) -> dict[str, Any]:
    """One episode of a policy for `FurnitureEnv.write_player`; what is not said here is as in `log_episodes`.

    Args:
        env: see there.
        policy: see there.
        title: shown above it.
        success: the first episode that ended so is given, or simulation 0's where none did; None: simulation 0's.
        signals: see there.
        enough: see there.
    """
    log = log_episodes(env, policy, None if success is not None else 1, signals, enough)
    (row,) = (0,) if success is None else rows_to_show([log], [success])
    return log.episode(row, title)


def rows_to_show(logs: Sequence[EpisodeLog], successes: Sequence[bool]) -> list[int]:
    """Of each log the simulation whose episode is shown: the same one, if in one of them all ended as wanted.

    The same simulation has the same start, where the environments were made alike. Else it is the first that ended as
    wanted of each, and simulation 0 where none did.
    """
    wanted = torch.stack([log.successes() == success for log, success in zip(logs, successes, strict=True)])
    chosen = wanted.all(0).expand_as(wanted) if wanted.all(0).any() else wanted
    return chosen.int().argmax(1).tolist()


def _kept(values: Tensor) -> Tensor:
    return values.detach().clone().cpu()
