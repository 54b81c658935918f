"""Every piece on the shelf: its config and picture are there, and the scripted assembler does it."""

from pathlib import Path

import pytest
import torch
import yaml
from worlds import make, run

from tstar_envs import furniture
from tstar_envs.furniture import names

ROOT = Path(__file__).resolve().parents[3]


def test_the_shelf_holds_what_it_should():
    pieces = {name: furniture.load(name) for name in names()}
    asked = {"table_lack", "chair_ingolf", "chair_agne", "chair_bernhard", "toy_table", "table_dockstra"}
    assert asked <= set(pieces) and len(pieces) >= 8
    assert any(len(piece.steps) == 7 and len(piece.parts) == 8 for piece in pieces.values())
    page, readme = ((ROOT / name).read_text() for name in ("docs/furniture_shelf.md", "README.md"))
    for name, piece in pieces.items():
        config = yaml.safe_load((ROOT / "configs" / "task" / f"{name}.yaml").read_text())
        assert (config["name"], config["subtasks"]) == (name, len(piece.steps))
        row = f"| `{name}` | {len(piece.parts)} | {len(piece.steps)} |"
        assert row in page and row in readme
        assert (ROOT / "docs" / "figures" / "shelf" / f"{name}.png").is_file()


@pytest.mark.parametrize("name", names())
def test_the_expert_assembles_the_piece(name):
    """Four whole pieces, from noisy starts; the shares of 200 are the slow test's."""
    world = make(4, None, seed=1, name=name, velocity_scale=0.4)
    success, returns = run(world, world.expert().act)
    assert success.sum() >= 3 and returns[success].min() > 20_000 * world.num_subtasks
    assert not world.state["wrong"].any() and world.failures == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", names())
def test_the_expert_assembles_each_step_and_the_whole_of_200(name):
    for subtask in [*range(len(furniture.load(name).steps)), None]:
        world = make(200, subtask, seed=2, name=name, velocity_scale=0.4, preassembled="jitter")
        success, _ = run(world, world.expert().act)
        assert success.double().mean() >= (0.85 if subtask is None else 0.95), subtask


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "step"), [("toy_table", 0), ("table_dockstra", 0), ("table_bjorkudden_0206", 4)]
)
def test_the_expert_finds_a_socket_with_action_noise(name, step):
    """The noise of noisy demonstrations: a part that is often beside the socket's mouth still gets in."""
    world = make(32, step, seed=3, name=name, velocity_scale=0.4, preassembled="jitter")
    expert, noise = world.expert(), torch.Generator().manual_seed(0)

    def act(state):
        action = expert.act(state)
        action[:, :7] += 0.15 * torch.randn(32, 7, generator=noise, dtype=torch.float64)
        return action

    success, _ = run(world, act)
    assert success.double().mean() > 0.4


def test_a_part_goes_into_a_socket_only_where_it_is_in_line_with_it():
    """At the mouth it waits until it fits; inside, the walls guide it; caught on the rim, it comes out again."""
    world = make(5, 0, name="toy_table")
    insertion, play = (float(x[0]) for x in (world.task.tables.insertion, world.task.tables.clearance))
    above = torch.tensor([0.012, 0.012, -0.03, -0.03, 0.012], dtype=torch.float64)  # over the mouth, m
    aside = torch.tensor([0.5, 1.2, 1.2, 3.0, 0.5], dtype=torch.float64) * play
    tilt = torch.tensor([0.05, 0.05, 0.15, 0.05, 0.15], dtype=torch.float64)
    zero = torch.zeros(5, 2, dtype=torch.float64)
    beside, turn = (torch.cat([x.unsqueeze(-1), zero], -1) for x in (aside, tilt))
    way = world.expert()._straight_way(world.state, -(insertion + above), beside, turn)
    assert way.is_one.all()
    assert (way.along < 0).tolist() == [True, False, True, False, False]
    assert way.first.tolist() == [False, False, False, True, False]
    up = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64)
    assert (way.goal(beside, up)[:, 0] == aside * ~way.first).all()


def test_a_jittered_part_stays_inside_its_socket():
    """A leg that is 64 mm in a socket with 10 mm of play starts at most 5 mm aside and 4.5 degrees off."""
    world = make(256, 1, name="toy_table", preassembled="jitter", jitter=0.012, jitter_degrees=10.0)
    aside, tilt = world.task.starts._play(0)
    assert aside == pytest.approx(0.005) and tilt == pytest.approx(0.005 / 0.064)
    tables, poses = world.task.tables, world.task.part_poses
    leg, top = poses[:, tables.moving[0]], poses[:, tables.target[0]]
    up = torch.nn.functional.cosine_similarity(_axis(leg), _axis(top))
    assert up.arccos().max() < tilt + 0.02 and world.failures == 0


def _axis(poses):
    from tstar_envs.geometry import up_axis

    return up_axis(poses[:, 3:])


def test_a_column_is_turned_over_the_way_the_wrist_can_go():
    """Half a turn about the hand: the last joint stays within its range, whichever way is nearer."""
    world = make(8, 1, name="table_dockstra", velocity_scale=0.4)
    expert, turned = world.expert(), torch.zeros(8, dtype=torch.float64)
    for _ in range(60):
        world.step(expert.act(world.state))
        turned = torch.maximum(turned, world.physics.qpos[:, 6].abs())
    assert turned.max() < 4.71
    column = world.task.part_poses[:, world.furniture.part_index("column")]
    assert (_axis(column)[:, 2] < -0.9).all()
