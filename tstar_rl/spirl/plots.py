"""What skills drawn from a prior do: played in the simulator from demonstrated states, and drawn."""

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import pandas as pd
import torch
from matplotlib import pyplot as plt
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.envs import ExplorationType, TransformedEnv, set_exploration_type

from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.env.layout import GRIP_POSITION
from tstar_rl.spirl.agent import SkillAgent, SkillPolicy
from tstar_rl.spirl.skill_model import make_skill_actor

__all__ = ["draw_skills", "moments", "play_skills"]

AXES = ("x", "y", "z")


def moments(expert: Demonstrations, number: int, horizon: int) -> Tensor:
    """Rows (number,) of states evenly spread over the last demonstration, the last of them a skill before its end."""
    length, end = int(expert.lengths[-1]), int(expert.lengths.sum())
    return end - length + torch.linspace(0, max(length - horizon - 1, 0), number).long()


@torch.no_grad()
def play_skills(agent: SkillAgent, env: TransformedEnv, expert: Demonstrations, rows: Tensor) -> pd.DataFrame:
    """Where the grip goes under skills drawn from the prior at demonstrated states, and where the demonstration went.

    Args:
        agent: with its prior and decoder.
        env: from `with_starts`, of a multiple of len(rows) simulations: so many skills a state.
        expert: whose states and snapshots are played from.
        rows: (M,) of the demonstrations.

    Returns:
        Columns state (which of `rows`), skill (-1: the demonstration), step, and x, y, z in m, world. A skill that ends
        the episode has fewer rows: the arm is put back home then.
    """
    skills = env.batch_size[0] // len(rows)
    starts, horizon = rows.repeat_interleave(skills), agent.settings.horizon
    policy = SkillPolicy(make_skill_actor(agent.model.prior), agent.model.decoder, horizon)
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
        for index, position in enumerate(torch.cat([positions, shown]).tolist()):
            state, skill = divmod(index, skills) if index < len(positions) else (index - len(positions), -1)
            table.append(
                {"state": state, "skill": skill, "step": step, **dict(zip(AXES, position, strict=True))}
            )
    return pd.DataFrame(table).dropna().round(5)


def _grip(tensordict: TensorDictBase) -> Tensor:
    """(N, 3), m, world."""
    return tensordict["observation"][:, GRIP_POSITION : GRIP_POSITION + 3].clone()


def draw_skills(paths: pd.DataFrame, path: str | Path) -> Path:
    """A column for each state, seen from above and from the side, in cm from where it starts; writes a PNG."""
    states = sorted(paths["state"].unique())
    figure, panels = plt.subplots(2, len(states), figsize=(2.6 * len(states), 5), squeeze=False)
    for state, column in zip(states, panels.T, strict=True):
        here = paths[paths["state"] == state]
        for axes, (a, b) in zip(column, (("x", "y"), ("x", "z")), strict=True):
            for skill, one in here.groupby("skill"):
                shown = one.sort_values("step")[[a, b]].to_numpy() * 100
                style = {"color": "black", "linewidth": 2} if skill == -1 else {"linewidth": 0.8}
                axes.plot(*(shown - shown[0]).T, **style)
            axes.set_xlabel(f"{a}, cm", fontsize=8)
            axes.set_ylabel(f"{b}, cm", fontsize=8)
            axes.tick_params(labelsize=7)
            axes.set_aspect("equal", "datalim")
            axes.grid(alpha=0.3)
        column[0].set_title(f"state {state}", fontsize=9)
    figure.suptitle("Grip under skills drawn from the prior (black: the demonstration)", fontsize=9)
    figure.tight_layout()
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)
    plt.close(figure)
    return Path(path)
