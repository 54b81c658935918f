"""The turn that brings one frame to another."""

import math

import pytest
import torch

from tstar_envs import geometry
from tstar_envs.experts.controller import rotation_vector


def frame(axis: list[float], angle: float) -> torch.Tensor:
    unit = torch.nn.functional.normalize(torch.tensor([axis], dtype=torch.float64))
    return geometry.quat_to_matrix(geometry.axis_angle_quat(unit, torch.tensor([angle], dtype=torch.float64)))


@pytest.mark.parametrize("axis", [[1.0, 0, 0], [0, 0, -1.0], [1.0, -2.0, 0.5]])
@pytest.mark.parametrize("angle", [0.0, 0.3, 3.1, math.pi])
def test_a_turn_is_found_again(axis, angle):
    """Half a turn is the same about an axis and about its opposite."""
    current = frame([0.2, 1.0, 0.1], 0.7)
    goal = frame(axis, angle) @ current
    found = rotation_vector(current, goal)
    length = float(found.norm())
    assert length == pytest.approx(angle, abs=1e-6)
    if length > 0:
        torch.testing.assert_close(frame(found[0].tolist(), length) @ current, goal, rtol=0, atol=1e-6)
