"""What latents drawn from a prior do: they are played in the simulator from demonstrated states, and drawn."""

from typing import Any

import pandas as pd
import torch
from matplotlib.figure import Figure
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.envs import ExplorationType, TransformedEnv, set_exploration_type

from tstar_rl.checks import InvalidValueError
from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.env.layout import GRIP_POSITION
from tstar_rl.spirl.agent import SpirlAgent
from tstar_rl.spirl.latent_execution import LatentPolicy
from tstar_rl.spirl.model import make_latent_actor

__all__ = ["evenly_spread_rows", "latents_figure", "play_latents"]

AXES = ("x", "y", "z")
DEMONSTRATION = -1
"""In the column "latent": the row is of the demonstration."""


def evenly_spread_rows(expert: Demonstrations, number: int, horizon: int) -> Tensor:
    """Rows (number,) of the last demonstration, evenly spread from its start to `horizon` steps before its end.

    Raises:
        InvalidValueError: if it is not longer than `horizon`.
    """
    length, end = int(expert.lengths[-1]), int(expert.lengths.sum())
    if length <= horizon:
        raise InvalidValueError(
            f"a latent plays {horizon} steps, and the last demonstration has {length}: spirl.model.horizon must be less"
        )
    return end - length + torch.linspace(0, length - horizon - 1, number).long()


@torch.no_grad()
def play_latents(
    agent: SpirlAgent, env: TransformedEnv, expert: Demonstrations, rows: Tensor
) -> pd.DataFrame:
    """Draws latents from the prior at demonstrated states, plays them, and returns the paths of the grip.

    Args:
        agent: its prior and its decoder are used.
        env: from `with_starts`. It has D x M simulations: D latents are drawn at each of M states.
        expert: the demonstrations; states and snapshots are taken from them.
        rows: (M,) of the demonstrations.

    Returns:
        Columns state (index in `rows`), latent (0 .. D-1, or -1 for the demonstration), step, and x, y, z in m, world.
        The path of a latent that ends its episode stops there, as the arm is then put back home.

    Raises:
        InvalidValueError: if the demonstrations have no states that can be restored.
    """
    if expert.snapshots.is_empty():
        raise InvalidValueError("the demonstrations have no states, so that nothing can be played from them")
    draws = env.batch_size[0] // len(rows)
    starts, horizon = rows.repeat_interleave(draws), agent.settings.horizon
    policy = LatentPolicy(make_latent_actor(agent.model.prior), agent.model.decoder, horizon)
    tensordict = env.reset()
    env.base_env.restore(expert.snapshots[starts])
    tensordict["observation"] = expert.observations[starts]
    paths, ended = [_grip(tensordict)], torch.zeros(env.batch_size, dtype=torch.bool, device=env.device)
    with set_exploration_type(ExplorationType.RANDOM):
        for _ in range(horizon):
            tensordict = env.step(policy(tensordict))
            ended |= tensordict["next", "done"].squeeze(-1)
            paths.append(_grip(tensordict["next"]).masked_fill(ended.unsqueeze(-1), torch.nan))
            tensordict = env.step_mdp(tensordict)
    table: list[dict[str, Any]] = []
    for step, positions in enumerate(paths):
        shown = expert.observations[rows + step, GRIP_POSITION : GRIP_POSITION + 3]
        names = [divmod(index, draws) for index in range(len(positions))]
        names += [(state, DEMONSTRATION) for state in range(len(shown))]
        for (state, latent), position in zip(names, torch.cat([positions, shown]).tolist(), strict=True):
            place = dict(zip(AXES, position, strict=True))
            table.append({"state": state, "latent": latent, "step": step, **place})
    return pd.DataFrame(table).dropna().round(5)


def _grip(tensordict: TensorDictBase) -> Tensor:
    """(N, 3), m, world."""
    return tensordict["observation"][:, GRIP_POSITION : GRIP_POSITION + 3].clone()


def latents_figure(paths: pd.DataFrame) -> Figure:
    """The table of `play_latents` as a figure.

    Each state has a column of two panels: seen from above, and from the side. Positions are in cm from the state.
    """
    states = sorted(paths["state"].unique())
    figure = Figure(figsize=(2.6 * len(states), 5))
    panels = figure.subplots(2, len(states), squeeze=False)
    for state, column in zip(states, panels.T, strict=True):
        here = paths[paths["state"] == state]
        for axes, (a, b) in zip(column, (("x", "y"), ("x", "z")), strict=True):
            for latent, one in here.groupby("latent"):
                shown = one.sort_values("step")[[a, b]].to_numpy() * 100
                style = {"color": "black", "linewidth": 2} if latent == DEMONSTRATION else {"linewidth": 0.8}
                axes.plot(*(shown - shown[0]).T, **style)
            axes.set_xlabel(f"{a}, cm", fontsize=8)
            axes.set_ylabel(f"{b}, cm", fontsize=8)
            axes.tick_params(labelsize=7)
            axes.set_aspect("equal", "datalim")
            axes.grid(alpha=0.3)
        column[0].set_title(f"state {state}", fontsize=9)
    figure.suptitle(
        "Path of the grip under latents drawn from the prior (black: the demonstration)", fontsize=9
    )
    figure.tight_layout()
    return figure
