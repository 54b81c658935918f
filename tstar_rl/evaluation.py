"""How good a policy is, on episodes that nothing was trained or chosen on."""

import math
from collections.abc import Callable
from typing import Any

import torch
from tensordict import TensorDictBase
from torchrl.envs import ExplorationType, TransformedEnv, set_exploration_type

from tstar_rl.collection import run_episodes

__all__ = ["MODES", "evaluate", "success_share", "summarize", "wilson_interval"]

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


def summarize(last: TensorDictBase, num_subtasks: int, subtask: int | None) -> dict[str, Any]:
    """A row of the evaluation table.

    Args:
        last: last steps of n episodes, batch [n].
        num_subtasks: K.
        subtask: the one that was run, or None for the whole task.

    Returns:
        episodes, progress (mean share of the subtasks to do that were done), success with its interval, and for
        each subtask that was run the share of episodes that completed it.
    """
    success, completed = (
        last["next", "success"].squeeze(-1),
        last["next", "completed"].squeeze(-1),
    )
    episodes, successes = len(success), int(success.sum())
    low, high = wilson_interval(successes, episodes)
    todo = num_subtasks if subtask is None else 1
    row: dict[str, Any] = {
        "episodes": episodes,
        "progress": float(completed.clamp(max=todo).double().mean()) / todo,
        "success": successes / episodes,
        "success_low": low,
        "success_high": high,
    }
    for index in range(num_subtasks):
        if subtask is None:
            row[f"subtask_{index}"] = float((completed > index).double().mean())
        else:
            row[f"subtask_{index}"] = row["success"] if index == subtask else float("nan")
    row["episode_length"] = float(last["next", "step_count"].double().mean())
    return row


def evaluate(
    policy: Callable,
    env: TransformedEnv,
    mode: str = "deterministic",
    each_step: Callable[[TensorDictBase], None] | None = None,
) -> dict[str, Any]:
    """One episode of every simulation of `env` (from `with_starts`), summarised.

    Raises:
        ValueError: if `mode` is not in `MODES`.
    """
    if mode not in MODES:
        raise ValueError(f"mode must be one of {', '.join(MODES)}; got {mode!r}")
    with set_exploration_type(MODES[mode]):
        last = run_episodes(env, policy, each_step)
    base = env.base_env
    return summarize(last, base.num_subtasks, getattr(base, "subtask", None))


def success_share(policy: Callable, env: TransformedEnv) -> float:
    """Share of deterministic episodes, one of every simulation, that succeed."""
    with set_exploration_type(ExplorationType.DETERMINISTIC), torch.no_grad():
        return float(run_episodes(env, policy)["next", "success"].float().mean())
