"""How much room a scene is given on Warp, by arithmetic alone: no kernel runs here."""

import mujoco
import pytest

from tstar_envs.furniture import library
from tstar_envs.physics.warp_scene import Room, room
from tstar_envs.scene import build_model

FREE_BODY = "<body><freejoint/>{}</body>"
BOX = '<geom type="box" size=".1 .1 .1"/>'
CYLINDER = '<geom type="cylinder" size=".1 .1"/>'
CAPSULE = '<geom type="capsule" size=".1 .1"/>'
SPHERE = '<geom type="sphere" size=".1"/>'


def of(*bodies: str) -> Room:
    floor = '<geom type="plane" size="1 1 1"/>'
    scene = floor + "".join(FREE_BODY.format(body) for body in bodies)
    return room(mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{scene}</worldbody></mujoco>"))


@pytest.mark.parametrize("name", library.names())
def test_no_piece_has_more_convex_pairs_than_contacts(name):
    """Warp refuses a scene that has."""
    given = room(build_model(library.load(name)))
    assert 0 < given.convex <= given.contacts < given.rows


@pytest.mark.parametrize(
    ("bodies", "pairs"),
    [
        ([BOX, CYLINDER], 1),
        ([CYLINDER, CYLINDER, CYLINDER], 3),
        ([CAPSULE, CYLINDER], 1),
        ([BOX, CAPSULE, SPHERE, BOX], 0),
        ([CYLINDER + BOX, CYLINDER + CAPSULE], 3),  # geoms of one body do not meet
    ],
)
def test_what_meets_a_cylinder_is_a_convex_pair(bodies, pairs):
    assert of(*bodies).convex == pairs


def test_everything_that_meets_the_floor_may_lie_on_it():
    assert of(BOX, CYLINDER, CAPSULE) == Room(contacts=12, rows=48, convex=2)


def test_no_more_pairs_are_counted_than_contacts():
    assert of(*[CYLINDER] * 10) == Room(contacts=40, rows=160, convex=40)  # of 45 pairs


def test_the_rooms_of_the_papers_pieces():
    """Every row costs a GPU time, so they change on purpose only."""
    rooms = {name: room(build_model(library.load(name))) for name in ("table_lack", "chair_ingolf")}
    assert rooms == {"table_lack": Room(84, 369, 5), "chair_ingolf": Room(136, 577, 18)}
