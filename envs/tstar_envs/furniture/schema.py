"""What a piece of furniture is: parts, the connectors on them, and the steps that assemble them.

Lengths in m, angles in rad, quaternions (w, x, y, z) of unit length, poses (x, y, z, w, x, y, z). Everything is
frozen, and checked when it is made, read from a file or built in Python: a `Furniture` that exists has values in their
bounds and steps that fit together. Whether the robot can assemble it is another question: see `tstar_envs.inspection`.

Source: docs/task.md, "Scene" and "Connection".
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from tstar_envs.furniture.consistency import LEAST_TRAVEL, check_furniture
from tstar_envs.furniture.errors import FurnitureError, did_you_mean
from tstar_envs.furniture.shapes import IDENTITY, Box, Capsule, Cylinder, Quat, Shape, Vec3

Pose = tuple[float, float, float, float, float, float, float]

DOWN: Vec3 = (0.0, 0.0, -1.0)
ANY_TURN = tuple(math.radians(degrees) for degrees in range(0, 360, 10))
"""`allowed_degrees: any`: at most 5 degrees off one of these, a connector counts as forward-aligned."""


@dataclass(frozen=True)
class Connector:
    """A place on a part where another part is joined.

    Its z axis ("up") and y axis ("forward") are what has to line up with the other connector's. It joins connectors
    whose kind is `mates_with`, at any of `allowed_angles` (rad) about the up axis.
    """

    name: str
    part: str
    pos: Vec3
    kind: str
    mates_with: str
    quat: Quat = IDENTITY
    allowed_angles: tuple[float, ...] = (0.0,)

    @property
    def turns_freely(self) -> bool:
        """Whether a round part fits however it is turned."""
        return self.allowed_angles == ANY_TURN


@dataclass(frozen=True)
class Grasp:
    """Where the fingers take a part, in its frame: the point between them, and the unit axis along which they close."""

    point: Vec3
    axis: Vec3


@dataclass(frozen=True)
class Part:
    """A rigid part: `density` is in kg / m^3, `initial_pose` is where it lies at the start (world frame)."""

    name: str
    initial_pose: Pose
    boxes: tuple[Box, ...]
    density: float
    connectors: tuple[Connector, ...] = ()
    grasps: tuple[Grasp, ...] = ()
    cylinders: tuple[Cylinder, ...] = ()
    capsules: tuple[Capsule, ...] = ()

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """What the part collides with."""
        return (*self.boxes, *self.cylinders, *self.capsules)

    @property
    def centre_of_mass(self) -> Vec3:
        """In the part's frame, m. What lies in two shapes counts twice, as it does in MuJoCo."""
        volumes = [shape.volume for shape in self.shapes]
        sums = [sum(v * s.pos[i] for v, s in zip(volumes, self.shapes, strict=True)) for i in range(3)]
        x, y, z = (each / sum(volumes) for each in sums)
        return x, y, z

    def connector(self, name: str) -> Connector:
        """Returns the connector of that name. Raises: FurnitureError if there is none."""
        return _find(self.connectors, name, f"connector of part {self.name!r}")


@dataclass(frozen=True)
class Step:
    """One subtask: the hand takes `moving_part` and joins its connector to the target's.

    Attributes:
        angle: which of the allowed rotations the assembly's drawing names, rad about the connectors' up axis. Where the
            part ends half a turn from its start, the sign says which way round it comes: as q or as -q.
        waypoint: the reward's lift point, (dx, dy, dz) from where the part lay, m; the script does not read it.
        grasp_index: which of the moving part's grasps to take.
        grip_angle: the hand's approach direction in the world while it grasps, a unit vector.
        grasp_from: where the hand waits before it grasps: `above` the grasp point, or `back` along `grip_angle`, as it
            must where a standing part is taken from the side.
        travel_height: height over the grasp point at which the hand comes there, m: over what stands in between.
        turn_height: height of the part's own middle above the floor, m, below which it cannot be turned; 0 where its
            connector's distance from that middle is what needs room. The middle is `RecipeTables.middle`.
        approach: how the moving connector comes to the target's: from straight `above`, or along their `axis`.
        insertion: length of the last stretch of that way, m, on which the part is inside the target or between its
            neighbours, so that it can only go straight.
        clearance: sideways play on that stretch, m.
    """

    moving_part: str
    target_part: str
    moving_connector: str
    target_connector: str
    angle: float
    waypoint: Vec3
    grasp_index: int = 0
    grip_angle: Vec3 = DOWN
    grasp_from: str = "above"
    travel_height: float = LEAST_TRAVEL
    turn_height: float = 0.0
    approach: str = "above"
    insertion: float = 0.0
    clearance: float = 0.015


@dataclass(frozen=True)
class Furniture:
    """A piece of furniture. Parts are in the order of the observation, steps in the order of assembly.

    Attributes:
        z_finedist: height above the target, m, to which the reward's phase `move_leg` leads the connector.
        no_contact: pairs of parts that pass through each other (docs/decisions/0007-chair.md).
        contact_impedance: MuJoCo's constraint impedance of the parts' contacts, in (0, 1): the nearer to 1 the
            stiffer. None is MuJoCo's own, 0.9 to 0.95, too soft where a light part carries heavier ones.
        weld_impedance: the same of the welds.
    """

    name: str
    parts: tuple[Part, ...]
    steps: tuple[Step, ...]
    z_finedist: float
    no_contact: tuple[tuple[str, str], ...] = ()
    contact_impedance: float | None = None
    weld_impedance: float | None = None

    def __post_init__(self) -> None:
        check_furniture(self)

    @property
    def part_names(self) -> tuple[str, ...]:
        return tuple(part.name for part in self.parts)

    def part(self, name: str) -> Part:
        """Returns the part of that name. Raises: FurnitureError if there is none."""
        return _find(self.parts, name, f"part of {self.name!r}")

    def part_index(self, name: str) -> int:
        """Returns the place of the part in `parts`, which is its place in the observation."""
        return self.parts.index(self.part(name))

    def connectors_of(self, step: int) -> tuple[Connector, Connector]:
        """Returns the (moving, target) connectors of a step."""
        s = self.steps[step]
        return self.part(s.moving_part).connector(s.moving_connector), self.part(s.target_part).connector(
            s.target_connector
        )

    def grasp_of(self, step: int) -> Grasp:
        """Returns where the hand takes the moving part in a step."""
        return self.part(self.steps[step].moving_part).grasps[self.steps[step].grasp_index]


def _find(items, name: str, what: str):
    for item in items:
        if item.name == name:
            return item
    raise FurnitureError(f"no {what} is called {name!r}: {did_you_mean(name, (item.name for item in items))}")
