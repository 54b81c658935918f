"""A part's frame may stand anywhere on it: the same piece is laid out and assembled in the same way."""

from dataclasses import replace

import pytest
import torch
from torch.testing import assert_close
from worlds import relative_poses

from tstar_envs import furniture, geometry
from tstar_envs.environment import BatchedEnvironment
from tstar_envs.furniture.schema import Furniture, Part
from tstar_envs.furniture.shapes import Vec3
from tstar_envs.tasks.recipe_tables import RecipeTables

CPU = torch.device("cpu")
STILL = {"part_noise": 0.0, "part_noise_degrees": 0.0, "arm_noise": 0.0}


def moved(part: Part, place: Vec3) -> Part:
    """The same part, its frame at `place` of the frame that it had, and turned as that was."""

    def seen(point: Vec3) -> Vec3:
        x, y, z = (a - b for a, b in zip(point, place, strict=True))
        return x, y, z

    pose = torch.tensor(part.initial_pose, dtype=torch.float64)
    at = pose[:3] + geometry.quat_rotate(pose[3:], torch.tensor(place, dtype=torch.float64))
    shapes = {
        kind: tuple(replace(shape, pos=seen(shape.pos)) for shape in getattr(part, kind))
        for kind in ("boxes", "cylinders", "capsules")
    }
    return replace(
        part,
        initial_pose=(*at.tolist(), *part.initial_pose[3:]),
        connectors=tuple(replace(one, pos=seen(one.pos)) for one in part.connectors),
        grasps=tuple(replace(one, point=seen(one.point)) for one in part.grasps),
        **shapes,
    )


def with_frames(piece: Furniture, places: dict[str, Vec3]) -> Furniture:
    """The piece with the frames of some parts elsewhere, by the parts' names."""
    parts = (moved(part, places[part.name]) if part.name in places else part for part in piece.parts)
    return replace(piece, parts=tuple(parts))


def at_connectors(piece: Furniture, step: int | None = None) -> Furniture:
    """The piece with frames at the connectors: of the part that moves in `step`, or of all that move."""
    steps = piece.steps if step is None else piece.steps[step : step + 1]
    found = {s.moving_part: piece.part(s.moving_part).connector(s.moving_connector).pos for s in steps}
    return with_frames(piece, found)


@pytest.mark.parametrize("name", furniture.names())
def test_a_piece_of_the_library_comes_from_where_it_did(name):
    """Its frames stand near its parts' middles; published starts and demonstrations took them for the middles."""
    tables = RecipeTables(furniture.load(name), CPU)
    connectors = tables.moving_connector
    beyond = (geometry.up_axis(connectors[:, 3:]) * connectors[:, :3]).sum(-1)
    assert torch.equal(tables.side, torch.where(beyond > 0, -1.0, 1.0).double())
    assert not tables.middle.any()


@pytest.mark.parametrize("name", furniture.names())
def test_a_part_with_its_frame_at_the_connector_comes_from_the_same_side(name):
    piece = furniture.load(name)
    tables = RecipeTables(piece, CPU)
    for k in range(tables.num_steps):
        other = RecipeTables(at_connectors(piece, k), CPU)
        assert torch.equal(other.side[k], tables.side[k]) and torch.equal(other.way_out[k], tables.way_out[k])


def test_a_jittered_part_with_its_frame_at_the_connector_lies_where_it_would(monkeypatch):
    piece, lie = furniture.load("table_lack"), []
    for one in (piece, at_connectors(piece)):
        world = BatchedEnvironment(one, 8, 3, 1, 0, {"preassembled": "jitter"})
        monkeypatch.setattr(world.physics, "settle", lambda mask, steps: torch.zeros_like(mask))
        world.reset()
        poses = [relative_poses(world, k) for k in range(3)]
        ends = world.task.tables.moving_connector[:3, :3]
        lie.append(
            torch.stack(
                [
                    pose[:, :3] + geometry.quat_rotate(pose[:, 3:], end.expand(8, 3))
                    for pose, end in zip(poses, ends, strict=True)
                ]
            )
        )
    assert_close(lie[0], lie[1], atol=1e-9, rtol=0)


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.13125), (0.0, 0.0, -0.2)])
def test_the_script_lifts_and_turns_a_part_about_its_middle(place):
    """Not about its frame, here at one end of a leg, or beyond the other."""
    piece, heights = furniture.load("table_lack"), []
    for one in (piece, with_frames(piece, {"leg_2": place})):
        world = BatchedEnvironment(one, 1, 0, 1, 0, STILL)
        world.reset()
        expert, found = world.expert(), []
        for _ in range(24):
            world.step(expert.act(world.state))
            found.append(float(world.task.scene(world.state).tip[0, 2]))
        heights.append(torch.tensor(found))
    assert heights[0].max() > 0.15  # it has been lifted
    assert_close(heights[0], heights[1], atol=2e-3, rtol=0)
