"""Steps that move what earlier steps built: the chair's third brings the seat with both its sides."""

import pytest
import torch
from torch import Tensor
from torch.testing import assert_close

import tstar_envs
from tstar_envs import furniture, geometry
from tstar_envs.connection import WrongPairs
from tstar_envs.environment import BatchedEnvironment
from tstar_envs.scene import build_model
from tstar_rl.env.furniture_env import FurnitureEnv
from tstar_rl.models.relative_features import RelativeFeatures

FRONT, LEFT, RIGHT, SEAT, BACK = range(5)
CHAIR = "chair_ingolf"


def make(subtask: int, num_sims: int = 2, **settings) -> BatchedEnvironment:
    world = tstar_envs.load(CHAIR, num_sims, subtask, 1, 0, velocity_scale=0.4, **settings)
    world.reset()
    return world


def between(poses: Tensor, one: int, other: int) -> Tensor:
    """(N, 7): part `other` in the frame of part `one`."""
    a, b = poses[:, one], poses[:, other]
    return torch.cat(geometry.relative_pose(a[:, :3], a[:, 3:], b[:, :3], b[:, 3:]), dim=-1)


def until_held(world: BatchedEnvironment) -> BatchedEnvironment:
    expert = world.expert()
    for _ in range(80):
        world.step(expert.act(world.state))
        if world.task.scene(world.state).touching.all():
            return world
    raise AssertionError("the expert did not take the part")


def test_groups_are_what_earlier_steps_joined():
    tables = make(0).task.tables
    groups = [tables.group[k].nonzero().flatten().tolist() for k in range(4)]
    assert groups == [[RIGHT], [LEFT], [LEFT, RIGHT, SEAT], [FRONT]]
    assert [tables.target[k].item() for k in range(4)] == [SEAT, SEAT, BACK, LEFT]


def test_move_group_is_rigid_and_leaves_the_others():
    world = make(2, 3)
    tables, poses = world.task.tables, world.task.part_poses.clone()
    turn = geometry.axis_angle_quat(torch.eye(3, dtype=torch.float64), torch.full((3,), 0.7).double())
    goal = torch.cat([poses[:, LEFT, :3] + 0.1, geometry.quat_mul(turn, poses[:, LEFT, 3:])], dim=-1)
    moved = tables.move_group(2, poses, goal)
    assert_close(moved[:, LEFT], goal)
    for part in (RIGHT, SEAT):
        assert_close(between(moved, LEFT, part), between(poses, LEFT, part))
        assert (moved[:, part] - poses[:, part]).abs().amax(-1).min() > 0.05
    assert torch.equal(moved[:, [FRONT, BACK]], poses[:, [FRONT, BACK]])


@pytest.mark.parametrize("preassembled", ["ideal", "jitter"])
def test_the_half_built_seat_stands_on_the_back(preassembled):
    """A start of the last step: the seat is upright, nothing falls over in three seconds, every weld holds."""
    world = make(3, 8, preassembled=preassembled)
    before = world.task.part_poses.clone()
    up = geometry.quat_to_matrix(before[:, SEAT, 3:])[..., 2]
    assert up[:, 2].abs().max() < 0.3 and up[:, 1].max() < -0.9
    idle = torch.tensor([0.0] * 7 + [-1.0, -1.0], dtype=torch.float64).repeat(8, 1)
    for _ in range(30):
        world.step(idle)
    assert (world.task.part_poses - before)[..., :3].abs().max() < 5e-3
    assert (world.task.part_poses - before)[..., 3:].abs().max() < 2e-2


def test_snapping_brings_the_group_along():
    world = make(2)
    poses = world.task.part_poses.clone()
    world.task.connect_ideally(2, torch.tensor([True, False]))
    made = world.task.part_poses
    assert_close(between(made, BACK, LEFT)[0], world.task.tables.ideal_relative_pose(2))
    for part in (RIGHT, SEAT):
        assert_close(between(made, LEFT, part)[0], between(poses, LEFT, part)[0])
    assert torch.equal(made[1], poses[1])


def test_fingers_on_a_welded_part_touch_the_group():
    world = until_held(make(2))
    touches = torch.zeros(2, 5, 2)  # contacts of finger and part
    touches[0, RIGHT], touches[1, SEAT] = 1.0, 1.0
    world.task._reader._contacts = touches
    assert world.task.scene(world.state).touching.all()
    touches[1] = 0.0
    touches[1, BACK] = 1.0
    assert not world.task.scene(world.state).touching.any()


@pytest.mark.parametrize("subtask", range(4))
def test_the_right_play_is_never_a_wrong_connection(subtask):
    """With every earlier step and this one made exactly, no other pair of connectors lines up."""
    world = make(subtask)
    everywhere = torch.ones(2, dtype=torch.bool)
    world.task.connect_ideally(subtask, everywhere)
    held = torch.ones(2, 5, dtype=torch.bool)
    wrong = WrongPairs(world.furniture, world.physics.device)
    assert not wrong.made(world.task.part_poses, held, torch.full((2,), subtask)).any()


@pytest.mark.parametrize("subtask", range(4))
def test_features_vanish_where_the_step_is_made(subtask):
    """Grasp error and connector error, as the policy sees them, against the task's own scene."""
    env = FurnitureEnv(CHAIR, 1, subtask=subtask, seed=0, velocity_scale=0.4)
    env.reset()
    world, features = env.world, RelativeFeatures(env.geometry(subtask)).double()
    until_held(world)
    out, scene = features(world.observation())[0], world.task.scene(world.state)
    assert_close(out[23:26] * 0.25, scene.moving_connector[0] - scene.target_connector[0], atol=1e-5, rtol=0)
    grip = world.observation()[0, 16:19]
    assert_close(out[20:23] * 0.25, grip - scene.grasp_point[0], atol=1e-5, rtol=0)
    assert_close(out[18], scene.alignment.forward_cosine[0], atol=1e-5, rtol=0)
    world.task.connect_ideally(subtask, torch.ones(1, dtype=torch.bool))
    out = features(world.observation())[0]
    assert out[23:26].abs().max() < 1e-4 and out[59:65].abs().max() < 1e-4
    assert_close(out[18], torch.ones((), dtype=torch.float64), atol=1e-5, rtol=0)


def test_parts_that_pass_through_each_other_are_compiled_so():
    piece = furniture.load(CHAIR)
    model = build_model(piece)
    assert model.nexclude == len(piece.no_contact) == 8
    assert build_model(furniture.load("table_lack")).nexclude == 0


def test_impedance_stiffens_parts_and_welds_alone():
    model = build_model(furniture.load(CHAIR))
    box = model.geom(model.body("seat").geomadr[0])
    assert_close(torch.tensor(box.solimp[:2]), torch.full((2,), 0.995, dtype=torch.float64))
    assert_close(torch.tensor(model.eq_solimp[:, :2]), torch.full((4, 2), 0.999, dtype=torch.float64))
    assert model.geom("floor").solimp[0] == model.geom("left_finger_pad").solimp[0] == 0.9
