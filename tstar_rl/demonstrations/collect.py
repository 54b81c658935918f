"""Runs the scripted expert and keeps its successes."""

import math
from collections.abc import Callable
from typing import Any

import torch
from tensordict import TensorDictBase
from torchrl.envs import TransformedEnv

from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.demonstrations.file_check import KINDS
from tstar_rl.demonstrations.header import DemonstrationError
from tstar_rl.env.task_tables import piece_digest
from tstar_rl.rollouts.episodes import run_episodes

__all__ = ["collect"]

ROUNDS = 20


def collect(
    make_env: Callable[[int], TransformedEnv],
    episodes: int,
    kind: str,
    noise: float,
    seed: int,
    each_step: Callable[[], None] = lambda: None,
) -> Demonstrations:
    """Runs the scripted expert until there are `episodes` successes; episodes count in the order of their start.

    Args:
        make_env: of a seed -> environment with snapshots=True, from `with_starts`.
        episodes: wanted.
        kind: one of `KINDS`.
        noise: deviation of the arm's executed action, for "noisy".
        seed: of the first round; each round has its own.
        each_step: called after every step, for a progress bar.

    Raises:
        ValueError: for another kind.
        DemonstrationError: if the expert fails too often to get there: in `ROUNDS` rounds of one episode a simulation,
            or in four of five episodes if that takes longer.
    """
    if kind not in KINDS:
        raise ValueError(f"kind must be one of {', '.join(KINDS)}; got {kind!r}")
    noise = noise if kind == "noisy" else 0.0
    pieces: list[TensorDictBase] = []
    seeds: list[int] = []
    env = make_env(seed)
    rounds = max(ROUNDS, 5 * math.ceil(episodes / env.batch_size[0]))
    try:
        for round_ in range(rounds):
            env.set_seed(seed + round_)
            torch_generator = torch.Generator().manual_seed(seed + round_)
            found = _successes(env, noise, torch_generator, each_step)
            pieces += found
            seeds += [seed + round_] * len(found)
            if len(pieces) >= episodes:
                break
        else:
            raise DemonstrationError(
                f"only {len(pieces)} of the {episodes} successes wanted came of {rounds} rounds of {env.batch_size[0]} "
                "episodes: the script does not do this task in this world, or not with so much noise"
            )
    finally:
        env.close()
    pieces, seeds = pieces[:episodes], seeds[:episodes]
    rows = torch.cat(pieces).cpu()
    base: Any = env.base_env
    arguments = base.arguments
    return Demonstrations(
        task=arguments["task"],
        subtask=arguments["subtask"],
        kind=kind,
        arguments=arguments,
        seeds=torch.tensor(seeds),
        lengths=torch.tensor([len(piece) for piece in pieces]),
        observations=rows["observation"],
        actions=rows["expert_action"],
        executed=rows["action"],
        success=torch.ones(len(pieces), dtype=torch.bool),
        snapshots=rows["snapshot"],
        noise=noise,
        furniture=piece_digest(base.world.furniture),
    )


def _successes(
    env: TransformedEnv,
    noise: float,
    generator: torch.Generator,
    each_step: Callable[[], None],
) -> list[TensorDictBase]:
    """The successful ones of one episode a simulation, each of batch [its length]."""
    steps: list[TensorDictBase] = []
    keep = ("observation", "snapshot", "action", "expert_action")

    def record(tensordict: TensorDictBase) -> None:
        steps.append(tensordict.select(*keep).clone())
        each_step()

    last = run_episodes(env, env.base_env.expert(noise, generator), record)
    together: TensorDictBase = torch.stack(steps, 1)  # pyright: ignore[reportAssignmentType]
    lengths = last["next", "step_count"].squeeze(-1)
    won = last["next", "success"].squeeze(-1)
    return [together[i, : int(lengths[i])] for i in won.nonzero().squeeze(-1).tolist()]
