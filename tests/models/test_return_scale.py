"""The deviation of discounted returns, by which rewards are divided."""

import pytest
import torch

from tstar_rl.models.return_scale import ReturnScale


def test_return_scale_by_hand():
    scale = ReturnScale()
    reward = torch.tensor([[[1.0], [2.0], [4.0]]])
    done = torch.tensor([[[False], [True], [False]]])
    scaled, carried = scale(reward, done, torch.zeros(1, 1), 0.5)
    # Returns 1, 2.5 and, after the end, 4: mean 2.5, variance (1.5^2 + 0 + 1.5^2) / 3 = 1.5.
    assert float(scale.var) == pytest.approx(1.5)
    torch.testing.assert_close(scaled, reward / 1.5**0.5)
    assert float(carried) == 4.0


def test_returns_that_are_all_alike_leave_rewards_as_they_are():
    scale, reward = ReturnScale(), torch.full((1, 1, 1), 3.0)
    scaled, _ = scale(reward, torch.zeros(1, 1, 1, dtype=torch.bool), torch.zeros(1, 1), 0.99)
    assert float(scaled) == 3.0
    scaled, _ = scale(reward + 2, torch.zeros(1, 1, 1, dtype=torch.bool), torch.zeros(1, 1), 0.99)
    assert float(scaled) == 5.0  # returns 3 and 5 have a deviation of 1


def test_return_scale_in_parts_is_that_of_the_whole():
    torch.manual_seed(0)
    reward, done = torch.randn(3, 8, 1), torch.rand(3, 8, 1) < 0.2
    whole, parts = ReturnScale(), ReturnScale()
    whole(reward, done, torch.zeros(3, 1), 0.9)
    _, carried = parts(reward[:, :5], done[:, :5], torch.zeros(3, 1), 0.9)
    parts(reward[:, 5:], done[:, 5:], carried, 0.9)
    torch.testing.assert_close(whole.var, parts.var)
