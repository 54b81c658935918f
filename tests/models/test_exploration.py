"""The deviation of actions that follows a schedule, on numbers worked by hand."""

import pytest
import torch
from tensordict import TensorDict

from tstar_rl.models.exploration import Exploration
from tstar_rl.models.networks import make_policy


@pytest.mark.parametrize(("progress", "arm", "hand"), [(0.0, 0.1, 0.04), (0.5, 0.2, 0.03), (1.0, 0.3, 0.02)])
def test_deviations_go_in_a_straight_line_from_the_first_to_the_last(progress, arm, hand):
    policy = make_policy(72, std="fixed", action_std=1.0)
    Exploration(arm=(0.1, 0.3), hand=(0.04, 0.02)).apply(policy, progress)
    found = policy(TensorDict(observation=torch.zeros(72)))["scale"]
    assert found.tolist() == pytest.approx([arm] * 7 + [hand] * 2)
