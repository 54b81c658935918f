"""Every equation on numbers worked by hand."""

import torch
from torch.testing import assert_close

from tstar_rl import equations


def test_gail_reward_is_a_clipped_parabola():
    f = torch.tensor([1.0, 0.0, 2.0, -1.0, 3.0, -5.0, 0.5])
    # 1 - 0.25 (f - 1)^2: at 0 and 2 it is 1 - 0.25, at -1 and 3 it is 1 - 1, at -5 it is -8, at 0.5 it is 1 - 0.0625
    assert_close(equations.gail_reward(f), torch.tensor([1.0, 0.75, 0.75, 0.0, 0.0, 0.0, 0.9375]))


def test_subtask_reward():
    r = equations.subtask_reward(torch.tensor([4.0, -2.0]), torch.tensor([0.5, 1.0]), 0.5, 0.25)
    assert_close(r, torch.tensor([2.125, -0.75]))  # 2 + 0.125, -1 + 0.25


def test_terminal_state_reward_is_paid_in_the_termination_set_only():
    d = torch.tensor([0.4, 0.4, 1.7, -0.3])
    inside = torch.tensor([True, False, True, True])
    assert_close(equations.terminal_state_reward(d, inside), torch.tensor([0.4, 0.0, 1.0, 0.0]))


def test_mixed_reward():
    r = equations.mixed_reward(
        torch.tensor([4.0]),
        torch.tensor([0.5]),
        torch.tensor([0.2]),
        lambda_1=0.5,
        lambda_2=0.5,
        lambda_3=10000,
    )
    assert_close(r, torch.tensor([2002.25]))  # 2 + 0.25 + 2000


def test_gail_discriminator_loss():
    # experts: (0^2 + 1^2) / 2 = 0.5; agents: (0^2 + 1^2 + 2^2) / 3 = 5/3
    loss = equations.gail_discriminator_loss(torch.tensor([1.0, 0.0]), torch.tensor([-1.0, 0.0, 1.0]))
    assert_close(loss, torch.tensor(0.5 + 5 / 3))


def test_initiation_set_loss():
    # initiation: (0^2 + 0.5^2) / 2 = 0.125; termination: (0^2 + 0.5^2 + 1) / 3 = 1.25 / 3
    loss = equations.initiation_set_loss(torch.tensor([1.0, 0.5]), torch.tensor([0.0, 0.5, 1.0]))
    assert_close(loss, torch.tensor(0.125 + 1.25 / 3))


def test_gradient_penalty_is_half_the_mean_squared_norm():
    grad = torch.tensor([[3.0, 4.0], [0.0, 1.0]])  # squared norms 25 and 1
    assert_close(equations.gradient_penalty(grad), torch.tensor(6.5))
