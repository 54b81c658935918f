"""Records episodes with their full states, and plays them again from the first of these, to the bit on the CPU.

Every episode here begins by putting a snapshot into the simulator, also one that is recorded for the first time. A
simulator that comes from a reset also knows which parts were about to fall asleep. No state holds that, and an episode
that began with it could be replayed to some 1e-5 only.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from tstar_rl.checks import InvalidValueError
from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.demonstrations.formats.recording import Episode, Recording, episode_differences
from tstar_rl.demonstrations.header import KINDS
from tstar_rl.env.task_tables import piece_digest
from tstar_rl.rollouts.collection import with_starts

__all__ = ["not_reproduced", "record", "replay", "replay_demonstrations"]

STEP = ("reward_env", "terminated", "truncated", "success")


def record(env: Any, policy: Callable, made_by: str, seed: int = 0) -> Recording:
    """One whole episode of each simulation, from a reset.

    Args:
        env: a `FurnitureEnv` with snapshots=True.
        policy: reads and writes TensorDicts of batch [N]; it samples as TorchRL's `set_exploration_type` says.
        made_by: see `Recording`.
        seed: that the environment was made with.
    """
    episodes = _play(env, env.reset()["snapshot"], policy, None)
    with_seeds = [replace(one, seed=seed) for one in episodes]
    return Recording(env.arguments, made_by, with_seeds, furniture=piece_digest(env.world.furniture))


def replay(env: Any, starts: TensorDictBase, actions: Sequence[Tensor]) -> list[Episode]:
    """Plays E episodes again: all of their actions, whatever ends an episode.

    Args:
        env: a `FurnitureEnv` with snapshots=True; its N simulations take N episodes at a time.
        starts: batch [E], the first state of each episode, at the beginning of a subtask.
        actions: E tensors (T, 9).
    """
    episodes: list[Episode] = []
    for first in range(0, len(actions), env.batch_size[0]):
        some = actions[first : first + env.batch_size[0]]
        idle = env.batch_size[0] - len(some)
        rows = torch.arange(first, first + env.batch_size[0]).clamp(max=len(actions) - 1)
        lengths = torch.tensor([*map(len, some), *[0] * idle])
        padded = torch.zeros(env.batch_size[0], int(lengths.max()), 9)
        for row, one in enumerate(some):
            padded[row, : len(one)] = one
        episodes += _play(env, starts[rows], _OpenLoop(padded), lengths)
    return episodes


def replay_demonstrations(env: Any, demonstrations: Demonstrations, source: str = "a file") -> Recording:
    """Demonstrations as episodes with rewards and final states: played again from their first states.

    Args:
        env: a `FurnitureEnv` with snapshots=True, of the arguments of the demonstrations.
        demonstrations: with snapshots.
        source: what they were read from, for people to read.

    Raises:
        InvalidValueError: they have none.
    """
    if demonstrations.snapshots.is_empty():
        raise InvalidValueError(
            f"demonstrations of {source} have no full states: they cannot be played again"
        )
    lengths: list[int] = demonstrations.lengths.tolist()
    first = demonstrations.lengths.cumsum(0) - demonstrations.lengths
    episodes = replay(env, demonstrations.snapshots[first], demonstrations.executed.split(lengths))
    labels, seeds = demonstrations.actions.split(lengths), demonstrations.seeds.tolist()
    together = zip(episodes, labels, seeds, strict=True)
    scripted, kind = demonstrations.kind in KINDS, demonstrations.kind
    return Recording(
        env.arguments,
        f"scripted assembler, {kind} demonstrations" if scripted else f"{kind} from {source}",
        [replace(episode, labels=label, seed=seed) for episode, label, seed in together],
        demonstrations.noise,
        piece_digest(env.world.furniture),
    )


def not_reproduced(env: Any, recording: Recording) -> dict[int, list[str]]:
    """The episodes that the simulator does not repeat to the bit from their first states, and what differs in each.

    There is none on the CPU, with the version of MuJoCo that the recording was made with.

    Args:
        env: a `FurnitureEnv` with snapshots=True, of the arguments of the recording.
        recording: its numbers are not looked at before they are compared.
    """
    episodes = recording.episodes
    starts: TensorDictBase = torch.stack([one.states[0] for one in episodes])  # pyright: ignore[reportAssignmentType]
    again = replay(env, starts, [one.actions for one in episodes])
    found = {row: episode_differences(*pair) for row, pair in enumerate(zip(episodes, again, strict=True))}
    return {row: told for row, told in found.items() if told}


@dataclass
class _Given:
    """Starts for all N simulations, batch [N], in their order; see `SkillChainReset`."""

    starts: TensorDictBase

    def sample(self, n: int, generator: torch.Generator) -> TensorDictBase:
        return self.starts[:n]


class _OpenLoop:
    """A policy that knows its actions (N, T, 9) beforehand."""

    def __init__(self, actions: Tensor) -> None:
        self.actions, self.step = actions, 0

    def __call__(self, tensordict: TensorDictBase) -> TensorDictBase:
        self.step += 1
        return tensordict.set("action", self.actions[:, self.step - 1].to(tensordict.device))


@torch.no_grad()
def _play(env: Any, starts: TensorDictBase, policy: Callable, lengths: Tensor | None) -> list[Episode]:
    """An episode from each of N starts, of `lengths` (N,) steps; None: until the environment ends it.

    A simulation with a length of 0 is left out of the episodes.
    """
    env = with_starts(env, _Given(starts), probability=1.0)
    tensordict = env.reset()
    log = _Log(tensordict)
    running = torch.ones(len(starts), dtype=torch.bool) if lengths is None else lengths > 0
    while running.any():
        tensordict = policy(tensordict)
        tensordict.set("action", tensordict["action"].float().clamp(-1.0, 1.0))
        if not running.all():
            tensordict.set("_step", running.to(tensordict.device, copy=True))
        tensordict = env.step(tensordict)
        log.take(tensordict, running)
        ended = tensordict["next", "done"].squeeze(-1).cpu() if lengths is None else log.lengths >= lengths
        running = running & ~ended
        tensordict = env.step_mdp(tensordict)
    return log.episodes()


class _Log:
    """Remembers what happened to N simulations."""

    def __init__(self, tensordict: TensorDictBase) -> None:
        self.states = [_kept(tensordict, "observation", "snapshot")]
        self.steps: list[TensorDictBase] = []
        self.lengths = torch.zeros(tensordict.batch_size[0], dtype=torch.int64)

    def take(self, tensordict: TensorDictBase, running: Tensor) -> None:
        """Adds a step of the simulations of `running` (N,)."""
        following: TensorDictBase = tensordict["next"]
        self.states.append(_kept(following, "observation", "snapshot"))
        self.steps.append(_kept(following, *STEP).set("action", tensordict["action"].cpu()))
        self.lengths = self.lengths + running

    def episodes(self) -> list[Episode]:
        """Of each simulation that took a step."""
        states, steps = torch.stack(self.states, 1), torch.stack(self.steps, 1)
        found = []
        for row, length in enumerate(self.lengths.tolist()):
            if length:
                state, step = states[row, : length + 1].clone(), steps[row, :length].clone()
                outcome = (step[name].squeeze(-1) for name in STEP)
                found.append(Episode(state["observation"], step["action"], *outcome, state["snapshot"]))
        return found


def _kept(tensordict: TensorDictBase, *names: str) -> TensorDict:
    """Copies on the CPU."""
    return tensordict.select(*names).to("cpu").clone()  # pyright: ignore[reportReturnType]
