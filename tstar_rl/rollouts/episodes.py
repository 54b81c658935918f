"""How good a policy is, on episodes that nothing was trained or chosen on."""

from collections.abc import Callable, Iterable
from typing import Any

import torch
from tensordict import TensorDictBase
from torch import nn
from torchrl.envs import ExplorationType, TransformedEnv, set_exploration_type

from tstar_rl.checks import InvalidValueError
from tstar_rl.intervals import share_columns

__all__ = ["MODES", "check_modes", "evaluate", "run_episodes", "same_policy", "summarize"]

MODES = {
    "deterministic": ExplorationType.DETERMINISTIC,
    "stochastic": ExplorationType.RANDOM,
}


@torch.no_grad()
def run_episodes(
    env: TransformedEnv,
    policy: Callable,
    each_step: Callable[[TensorDictBase], None] | None = None,
    enough: int | None = None,
    rows: torch.Tensor | None = None,
) -> TensorDictBase:
    """One whole episode of every simulation, from a reset. A simulation whose episode has ended is not stepped.

    Args:
        env: from `with_starts`.
        policy: reads and writes TensorDicts; it samples as TorchRL's `set_exploration_type` says.
        each_step: called with every step's TensorDict, batch [N]. A row is of use until its first "done".
        enough: subtasks after which an episode counts as ended too; None: the environment alone ends it.
        rows: (N,) bool, the simulations that run; None: all.

    Returns:
        The last step of each episode, batch [N], in the order of the simulations. Rows that do not run mean nothing.

    Raises:
        InvalidValueError: if no simulation runs.
    """
    if rows is not None and not rows.any():
        raise InvalidValueError("rows must be true for one simulation at least: none would run")
    tensordict = env.reset()
    everything = torch.ones(env.batch_size, dtype=torch.bool, device=tensordict.device)
    running = everything if rows is None else rows.clone()
    last: TensorDictBase | None = None
    while running.any():
        tensordict = policy(tensordict)
        if not running.all():
            tensordict.set("_step", running.clone())
        tensordict = env.step(tensordict)
        if each_step is not None:
            each_step(tensordict)
        ended = tensordict["next", "done"].squeeze(-1)
        if enough is not None:
            ended = ended | (tensordict["next", "completed"].squeeze(-1) >= enough)
        ended = running & ended
        if last is None:
            last = tensordict.clone()
        elif ended.any():
            last[ended] = tensordict[ended]
        running &= ~ended
        tensordict = env.step_mdp(tensordict)
    assert last is not None
    return last


def summarize(
    last: TensorDictBase, num_subtasks: int, subtask: int | None, links: int | None = None
) -> dict[str, Any]:
    """A row of the evaluation table.

    Args:
        last: last steps of n episodes, batch [n].
        num_subtasks: K.
        subtask: the one that was run, or None for the whole task.
        links: number of subtasks that a shorter chain does; success is then that it has done these. None: all.

    Returns:
        episodes, progress (mean share of the subtasks to do that were done), success with its interval, and for
        each subtask that was run the share of episodes that completed it.
    """
    completed = last["next", "completed"].squeeze(-1)
    todo = 1 if subtask is not None else links or num_subtasks
    shorter = subtask is None and todo < num_subtasks
    success = completed >= todo if shorter else last["next", "success"].squeeze(-1)
    episodes, successes = len(success), int(success.sum())
    progress = float(completed.clamp(max=todo).double().mean()) / todo
    row: dict[str, Any] = {"episodes": episodes, "progress": progress}
    row |= share_columns("success", successes, episodes)
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
            raise InvalidValueError(f"mode must be one of {', '.join(MODES)}; got {mode!r}")


def evaluate(
    policy: Callable,
    env: TransformedEnv,
    mode: str = "deterministic",
    each_step: Callable[[TensorDictBase], None] | None = None,
    links: int | None = None,
) -> dict[str, Any]:
    """One episode of every simulation of `env` (from `with_starts`), summarised.

    Args:
        policy: reads and writes TensorDicts.
        env: batch [N].
        mode: of `MODES`.
        each_step: see `run_episodes`.
        links: number of subtasks that a shorter chain does, after which its episode is over; None: all.

    Raises:
        ValueError: if `mode` is not in `MODES`.
    """
    check_modes([mode])
    with set_exploration_type(MODES[mode]):
        last = run_episodes(env, policy, each_step, enough=links)
    base = env.base_env
    return summarize(last, base.num_subtasks, getattr(base, "subtask", None), links)


def same_policy(first: nn.Module, second: nn.Module) -> bool:
    """Whether two policies have the same parameters and buffers, bit for bit."""
    these, those = first.state_dict(), second.state_dict()
    return these.keys() == those.keys() and all(torch.equal(these[name], those[name]) for name in these)
