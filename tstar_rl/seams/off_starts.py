"""How far from its own starts the world is that a skill is handed: joints in degrees, parts in metres and degrees.

A skill trains from its own starts. Where it is handed an arm or a part in a pose that these did not have, its inputs
are ones that it never saw.

Source of the mean orientation: Markley et al., Averaging Quaternions, 2007.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from tstar_rl.env.layout import JOINTS
from tstar_rl.env.poses import pose_from
from tstar_rl.seams.apart import angles_between, part_poses

__all__ = ["Off", "off_starts"]


class Off(NamedTuple):
    """Distances from the mean of a skill's own starts, medians over states: in degrees or, of a position, m."""

    handed: float
    """Of the states that the skill is handed."""
    own: float
    """Of its own starts themselves: what it saw."""


def off_starts(
    handed: Tensor, own: Tensor, parts: Sequence[str], joined: Mapping[int, int] | None = None
) -> dict[str, Off]:
    """By the groups of `input_groups`: the robot's joints, then position and orientation of each part.

    Args:
        handed: (n, O), observations in which a skill takes over.
        own: (m, O), those of its own starts, m > 0.
        parts: names, in the order of the observation.
        joined: a part that is joined by then: the part that it is joined to, whose frame its pose is taken in. Both by
            their place in the observation. The others' poses are the world's.

    Returns:
        `handed` is nan where there are no states.
    """
    joints = [torch.rad2deg(each[:, :JOINTS].double().cpu()) for each in (handed, own)]
    found = {"robot": _off(*joints)}
    poses = [part_poses(each).double() for each in (handed, own)]
    for index, name in enumerate(parts):
        first, second = (pose_from(each, index, (joined or {}).get(index)) for each in poses)
        found[f"{name} position"] = _off(first[0], second[0])
        mean = torch.linalg.eigh(second[1].T @ second[1]).eigenvectors[:, -1]
        found[f"{name} orientation"] = Off(
            *(_median(angles_between(each[1], mean)) for each in (first, second))
        )
    return found


def _off(handed: Tensor, own: Tensor) -> Off:
    """Of vectors (n, d) and (m, d): distance from the mean of the second."""
    mean = own.mean(0)
    return Off(*(_median((each - mean).norm(dim=-1)) for each in (handed, own)))


def _median(distances: Tensor) -> float:
    return float(distances.quantile(0.5)) if len(distances) else math.nan
