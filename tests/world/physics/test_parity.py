"""The GPU's simulator against the processor's: same snapshots and actions, how far they part and after how long.

Tolerances and horizons: docs/decisions/0011-gpu-simulator.md.
"""

import runpy
import sys
from pathlib import Path

import pandas as pd
import pytest
import torch
import warp_worlds
from hydra.core.global_hydra import GlobalHydra
from tensordict import TensorDict
from torch import Tensor
from worlds import run

import tstar_envs
from tstar_envs.environment import BatchedEnvironment

pytestmark = pytest.mark.parametrize("device", warp_worlds.DEVICES)
REACH, CARRY = 15, 60
"""Control steps: before the hand closes, and past the connection."""


def side_by_side(device: str, start: TensorDict, cpu: BatchedEnvironment, act, steps: int) -> list[dict]:
    """Steps both from `start` under the actions that `act` gives the processor's simulations."""
    world = warp_worlds.make(cpu.num_sims, cpu.subtask, device=device)
    world.restore(start.to(device))
    rows = []
    for _ in range(steps):
        action = act(cpu.state)
        cpu.step(action)
        world.step(action.to(device))
        ours, theirs = {name: value.cpu() for name, value in world.state.items()}, cpu.state
        rows.append(
            {
                "observation": (world.observation().cpu() - cpu.observation())[:, :64].abs().max().item(),
                "reward": (ours["reward"] - theirs["reward"]).abs(),
                "phase": (ours["phase"], theirs["phase"].clone()),
                "completed": (ours["completed"], theirs["completed"].clone()),
            }
        )
    return rows


def first_time(rows: list[dict], name: str, value: int) -> tuple[Tensor, Tensor]:
    """The step (N,) at which a count first reached `value`, on Warp and on the processor; the horizon if never."""
    reached = [torch.stack([row[name][i] for row in rows]) >= value for i in (0, 1)]
    never = torch.full((1, reached[0].shape[1]), True)
    return tuple(torch.cat([found, never]).int().argmax(0) for found in reached)  # pyright: ignore


@pytest.mark.parametrize("subtask", [0, 1])
def test_the_experts_actions(device, subtask):
    """Reach, grasp, carry, connect and go home; on subtask 1 with a weld active."""
    cpu = tstar_envs.load("table_lack", 3, subtask, 1, seed=4)
    cpu.reset()
    rows = side_by_side(device, cpu.snapshot(), cpu, cpu.expert().act, CARRY)
    reach, rest = rows[:REACH], rows[REACH:]
    assert max(row["observation"] for row in reach) < 1e-4
    assert max(row["reward"].max() for row in reach) < 0.05
    assert all(torch.equal(*row["phase"]) for row in reach)
    assert max(row["observation"] for row in rest) < 0.02
    events = [first_time(rows, "completed", 1)]
    assert (events[0][1] < CARRY).any()
    events += [first_time(rows[: int(events[0][1].min())], "phase", phase) for phase in range(2, 8)]
    assert all((ours - theirs).abs().max() <= 1 for ours, theirs in events)
    level = [row["reward"][row["phase"][0] == row["phase"][1]] for row in rest]
    assert torch.cat(level).quantile(0.9) < 1.0  # a bonus is 5,000


def test_random_actions(device):
    """No part is pressed deep into the floor here: there Warp makes more contacts, see "One step" in decision 0011."""
    cpu = tstar_envs.load("table_lack", 3, 0, 1, seed=5)
    cpu.reset()
    generator = torch.Generator().manual_seed(0)
    rows = side_by_side(
        device,
        cpu.snapshot(),
        cpu,
        lambda state: 2 * torch.rand(3, 9, generator=generator, dtype=torch.float64) - 1,
        20,
    )
    assert max(row["observation"] for row in rows) < 1e-3
    assert max(row["reward"].max() for row in rows) < 0.5
    assert all(torch.equal(*row["phase"]) and torch.equal(*row["completed"]) for row in rows)


@pytest.mark.slow
@pytest.mark.parametrize("subtask", [0, 3])
def test_the_expert_succeeds_as_often(device, subtask):
    """At most 3 points apart; 200 episodes are in decision 0011, these are 64."""
    worlds = warp_worlds.make(64, subtask, device=device), tstar_envs.load("table_lack", 64, subtask, 1, 0)
    worlds[1].reset()
    ours, theirs = (run(world, world.expert().act)[0].double().mean() for world in worlds)
    assert abs(float(ours) - float(theirs)) <= 0.03


@pytest.mark.slow
def test_the_recipe_writes_what_it_measured(device, tmp_path, monkeypatch):
    values = ["subtask=1", "episodes=3", "compared=2", f"device={device}", f"results_dir={tmp_path}"]
    monkeypatch.setattr(sys, "argv", ["parity.py", *values])
    GlobalHydra.instance().clear()
    runpy.run_path(str(Path(__file__).resolve().parents[3] / "recipes" / "parity.py"), run_name="__main__")
    row = pd.read_csv(tmp_path / "parity.csv").iloc[0]
    assert (row["task"], row["subtask"], row["device"]) == ("table_lack", 1, device)
    assert row["success_mujoco"] == row["success_warp"] == 1 and row["episodes_that_differ"] == 0
    assert row["observation_1"] < 1e-5 and row["observation_10"] < 1e-4 and row["observation_60"] < 0.02
    assert 0 < row["reward_10"] < 0.05 and row["steps_apart"] <= 2
