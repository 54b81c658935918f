"""Whether the scripted expert assembles, and what it is paid."""

import pytest
import torch
from worlds import PIECES, make, run

from tstar_envs import geometry


@pytest.mark.parametrize(("subtask", "bonuses"), [(0, 25_000), (1, 25_000), (2, 40_000), (3, 25_000)])
def test_the_expert_is_paid_for_the_chair(subtask, bonuses):
    """Three bonuses of 5,000 up to the grasp and 10,000 for connecting; the long step passes the phases between too."""
    world = make(4, subtask, name="chair_ingolf", velocity_scale=0.4)
    success, returns = run(world, world.expert().act)
    assert success.all() and returns.min() > bonuses


def test_the_expert_returns_more_than_chance():
    world = make(8)
    _, expert = run(world, world.expert().act)
    world = make(8)
    chance = torch.Generator().manual_seed(0)
    success, random = run(world, lambda _: 2 * torch.rand(8, 9, generator=chance, dtype=torch.float64) - 1)
    assert expert.min() > 40_000 and random.max() < 10_000 and not success.any()


QUICK, LONG = 16, 64


@pytest.mark.parametrize("name", PIECES)
@pytest.mark.parametrize("subtask", range(4))
@pytest.mark.parametrize("speed", [1.0, 0.4])
@pytest.mark.parametrize(
    ("episodes", "preassembled"),
    [(QUICK, "ideal"), *(pytest.param(LONG, how, marks=pytest.mark.slow) for how in ("ideal", "jitter"))],
)
def test_the_expert_assembles_every_subtask(name, subtask, speed, episodes, preassembled):
    world = make(episodes, subtask, seed=1, name=name, velocity_scale=speed, preassembled=preassembled)
    success, _ = run(world, world.expert().act)
    wanted = {"table_lack": 0.98, "chair_ingolf": 0.95}[name] if episodes == LONG else 0.9
    assert success.double().mean() >= wanted and not world.state["wrong"].any()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "speed", "wanted"),
    [("table_lack", 1.0, 0.92), ("chair_ingolf", 1.0, 0.85), ("chair_ingolf", 0.4, 0.85)],
)
def test_the_expert_assembles_the_whole_piece(name, speed, wanted):
    world = make(200, None, seed=1, name=name, velocity_scale=speed)
    success, _ = run(world, world.expert().act)
    assert success.double().mean() >= wanted


def test_a_round_part_that_is_held_along_its_axis_has_its_own_frame():
    """Which way such a hand leans, by a milliradian, says nothing of how far the part slipped."""
    world = make(8, 0, name="toy_table")
    expert, tables = world.expert(), world.task.tables
    assert tables.turns_freely[0]
    expert._hand_in_connector[0] = torch.tensor([0.0, 0.0, -1.0])
    part = geometry.quat_to_matrix(world.task.part_poses[:, tables.moving[0], 3:])
    moving = part @ tables.moving_frame[0]
    leans = 1e-3 * torch.randn(8, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    found, _ = expert._connector_frames(world.state, -moving[:, :, 2] + leans)
    torch.testing.assert_close(found, moving)
