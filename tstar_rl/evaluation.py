"""How good a policy is, on episodes that nothing was trained or chosen on."""

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import nn
from torchrl.envs import ExplorationType, TransformedEnv, set_exploration_type

from tstar_rl.collection import run_episodes
from tstar_rl.watching import EpisodeLog, Signal

__all__ = ["MODES", "Recorder", "check_modes", "evaluate", "same_policy", "summarize", "wilson_interval"]

MODES = {
    "deterministic": ExplorationType.DETERMINISTIC,
    "stochastic": ExplorationType.RANDOM,
}


def wilson_interval(successes: int, episodes: int, z: float = 1.96) -> tuple[float, float]:
    """Confidence interval of a share, 95% at z = 1.96.

    Source: Wilson 1927.
    """
    if episodes < 1 or not 0 <= successes <= episodes:
        raise ValueError(f"need 0 <= successes <= episodes and episodes >= 1, got {successes} of {episodes}")
    share, scale = successes / episodes, 1 + z**2 / episodes
    centre = (share + z**2 / (2 * episodes)) / scale
    half = z / scale * math.sqrt(share * (1 - share) / episodes + z**2 / (4 * episodes**2))
    return max(centre - half, 0.0), min(centre + half, 1.0)


def summarize(
    last: TensorDictBase, num_subtasks: int, subtask: int | None, links: int | None = None
) -> dict[str, Any]:
    """A row of the evaluation table.

    Args:
        last: last steps of n episodes, batch [n].
        num_subtasks: K.
        subtask: the one that was run, or None for the whole task.
        links: of a chain that does the first so many subtasks, which are then all there is to do; None: all.

    Returns:
        episodes, progress (mean share of the subtasks to do that were done), success with its interval, and for
        each subtask that was run the share of episodes that completed it.
    """
    completed = last["next", "completed"].squeeze(-1)
    todo = 1 if subtask is not None else links or num_subtasks
    shorter = subtask is None and todo < num_subtasks
    success = completed >= todo if shorter else last["next", "success"].squeeze(-1)
    episodes, successes = len(success), int(success.sum())
    low, high = wilson_interval(successes, episodes)
    row: dict[str, Any] = {
        "episodes": episodes,
        "progress": float(completed.clamp(max=todo).double().mean()) / todo,
        "success": successes / episodes,
        "success_low": low,
        "success_high": high,
    }
    for index in range(num_subtasks):
        run = index < todo if subtask is None else index == subtask
        share = row["success"] if index == subtask else float((completed > index).double().mean())
        row[f"subtask_{index}"] = share if run else float("nan")
    row["episode_length"] = float(last["next", "step_count"].double().mean())
    return row


def check_modes(modes: Iterable[str]) -> None:
    """Raises a ValueError for a mode that is not in `MODES`."""
    for mode in modes:
        if mode not in MODES:
            raise ValueError(f"mode must be one of {', '.join(MODES)}; got {mode!r}")


def evaluate(
    policy: Callable,
    env: TransformedEnv,
    mode: str = "deterministic",
    each_step: Callable[[TensorDictBase], None] | None = None,
    links: int | None = None,
) -> dict[str, Any]:
    """One episode of every simulation of `env` (from `with_starts`), summarised.

    Raises:
        ValueError: if `mode` is not in `MODES`.
    """
    check_modes([mode])
    with set_exploration_type(MODES[mode]):
        last = run_episodes(env, policy, each_step)
    base = env.base_env
    return summarize(last, base.num_subtasks, getattr(base, "subtask", None), links)


def same_policy(first: nn.Module, second: nn.Module) -> bool:
    """Whether two policies have the same parameters and buffers, bit for bit."""
    these, those = first.state_dict(), second.state_dict()
    return these.keys() == those.keys() and all(torch.equal(these[name], those[name]) for name in these)


class Recorder:
    """Remembers what the simulations did, to show the first success and the first failure among them.

    Args:
        env: with `qpos_of`, `write_mp4` and `write_player`, and snapshots=True.
        number: of the first so many simulations; None: of all, which takes 4 (nq + 5) bytes a step (200 episodes
            of 800 steps: 31 MB); 0: of none.
        signals: what else to show of each step, by name.
    """

    def __init__(
        self, env: Any, number: int | None = None, signals: Mapping[str, Signal] | None = None
    ) -> None:
        if number is not None and number < 0:
            raise ValueError(f"number must not be negative, got {number}")
        self.env, self.number = env, number
        self.log = EpisodeLog(env, number, signals)

    def __call__(self, tensordict: TensorDictBase) -> None:
        """Takes the step's TensorDict, batch [N]."""
        if self.number != 0:
            self.log(tensordict)

    def write(self, folder: Path) -> list[Path]:
        """Writes first_success.mp4, first_failure.mp4 and, with both, episodes.html; returns the paths of those made.

        What an earlier evaluation left is deleted first, unless nothing was to be remembered.
        """
        written, shown = [], []
        if self.number == 0:
            return written
        won = self.log.successes()
        for name, rows in (("first_failure", ~won), ("first_success", won)):
            path = folder / f"{name}.mp4"
            path.unlink(missing_ok=True)
            if rows.any():
                row = int(rows.int().argmax())
                shown.append(self.log.episode(row, name.replace("_", " ")))
                if self.env.write_mp4(path, self.log.positions(row)[1:]):
                    written.append(path)
        return [*written, self.env.write_player(folder / "episodes.html", shown)]
