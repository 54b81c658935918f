"""The distance and angle between two poses, on numbers worked by hand."""

import math

import pytest
import torch

from tstar_rl.seams.apart import apart


@pytest.mark.parametrize("degrees", [0.0, 0.01, 30.0, 180.0, 350.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_q_and_its_negative_are_one_turn(degrees, sign):
    half = math.radians(degrees) / 2
    first = torch.tensor([0.1, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    second = torch.tensor([0.1, 0.3, 0.4, sign * math.cos(half), 0.0, sign * math.sin(half), 0.0])
    found = apart("leg", first, second)
    assert list(found) == ["leg_moved", "leg_turned"]
    assert found["leg_moved"] == 0.5
    assert found["leg_turned"] == pytest.approx(min(degrees, 360 - degrees), abs=0.005)
