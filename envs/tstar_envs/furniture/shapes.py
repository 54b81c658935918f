"""The shapes that parts are made of: boxes, cylinders and capsules, each placed in its part's frame.

Lengths in m, quaternions (w, x, y, z). A cylinder or capsule stands along its own z axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]

IDENTITY: Quat = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Box:
    """One collision box: half-sizes, and its place in the part's frame."""

    size: Vec3
    pos: Vec3 = (0.0, 0.0, 0.0)
    quat: Quat = IDENTITY

    @property
    def extent(self) -> float:
        """Its longest side, m."""
        return 2 * max(self.size)

    @property
    def volume(self) -> float:
        """m^3."""
        return 8 * math.prod(self.size)


@dataclass(frozen=True)
class Cylinder:
    """A cylinder with flat ends, `2 * half_length` long."""

    radius: float
    half_length: float
    pos: Vec3 = (0.0, 0.0, 0.0)
    quat: Quat = IDENTITY

    @property
    def size(self) -> Vec3:
        """MuJoCo's sizes: radius, half-length, unused."""
        return (self.radius, self.half_length, 0.0)

    @property
    def extent(self) -> float:
        """From end to end or across, whichever is more, m."""
        return 2 * max(self.half_length, self.radius)

    @property
    def volume(self) -> float:
        """m^3."""
        return 2 * math.pi * self.radius**2 * self.half_length


@dataclass(frozen=True)
class Capsule(Cylinder):
    """A cylinder with round ends."""

    @property
    def extent(self) -> float:
        """From tip to tip, m."""
        return 2 * (self.half_length + self.radius)

    @property
    def volume(self) -> float:
        """m^3, with the two half balls at its ends."""
        return super().volume + 4 / 3 * math.pi * self.radius**3


Shape = Box | Cylinder
