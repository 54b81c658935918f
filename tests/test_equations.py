"""Every equation on numbers worked by hand."""

import math

import torch
from torch.testing import assert_close

from tstar_rl import equations


def test_gail_reward_is_a_clipped_parabola():
    f = torch.tensor([1.0, 0.0, 2.0, -1.0, 3.0, -5.0, 0.5])
    # 1 - 0.25 (f - 1)^2: at 0 and 2 it is 1 - 0.25, at -1 and 3 it is 1 - 1, at -5 it is -8, at 0.5 it is 1 - 0.0625
    assert_close(equations.gail_reward(f), torch.tensor([1.0, 0.75, 0.75, 0.0, 0.0, 0.0, 0.9375]))


def test_the_reward_of_learning_a_subtask():
    r = equations.weighted_reward([torch.tensor([4.0, -2.0]), torch.tensor([0.5, 1.0])], [0.5, 0.25])
    assert_close(r, torch.tensor([2.125, -0.75]))  # 2 + 0.125, -1 + 0.25


def test_terminal_state_reward_is_paid_in_the_termination_set_only():
    d = torch.tensor([0.4, 0.4, 1.7, -0.3])
    inside = torch.tensor([True, False, True, True])
    assert_close(equations.terminal_state_reward(d, inside), torch.tensor([0.4, 0.0, 1.0, 0.0]))


def test_the_reward_of_chaining():
    rewards = [torch.tensor([value]) for value in (4.0, 0.5, 0.2)]
    r = equations.weighted_reward(rewards, [0.5, 0.5, 10000])
    assert_close(r, torch.tensor([2002.25]))  # 2 + 0.25 + 2000


def test_least_squares_loss():
    # distances from +1 are 0 and 1, from -1 they are 2 and 1: (0 + 1) / 2 and (4 + 1) / 2
    scores = torch.tensor([1.0, 0.0])
    assert_close(equations.least_squares_loss(scores, 1.0), torch.tensor(0.5))
    assert_close(equations.least_squares_loss(scores, -1.0), torch.tensor(2.5))


def test_gradient_penalty_is_half_the_mean_squared_norm():
    grad = torch.tensor([[3.0, 4.0], [0.0, 1.0]])  # squared norms 25 and 1
    assert_close(equations.gradient_penalty(grad), torch.tensor(6.5))


def test_unit_gradient_penalty_is_the_mean_squared_distance_of_the_norm_from_one():
    grad = torch.tensor([[3.0, 4.0], [0.0, 1.0]])  # norms 5 and 1
    assert_close(equations.unit_gradient_penalty(grad), torch.tensor(8.0))  # (16 + 0) / 2


def test_gaussian_kl_of_diagonal_gaussians():
    # In one dimension: ln(s2 / s1) + (s1^2 + (m1 - m2)^2) / (2 s2^2) - 1/2.
    # The first: ln 2 + (1 + 1) / 8 - 1/2; the second: equal.
    kl = equations.gaussian_kl(
        torch.tensor([[1.0, 3.0]]),
        torch.tensor([[1.0, 0.5]]),
        torch.tensor([[2.0, 3.0]]),
        torch.tensor([[2.0, 0.5]]),
    )
    assert_close(kl, torch.tensor([math.log(2) - 0.25]))
    # The order matters: ln(1/2) + (4 + 1) / 2 - 1/2 the other way round.
    back = equations.gaussian_kl(*(torch.tensor([x]) for x in (2.0, 2.0, 1.0, 1.0)))
    assert_close(back, torch.tensor(2.0 - math.log(2)))


def test_latent_reconstruction_is_half_the_mean_squared_error():
    loss = equations.latent_reconstruction_loss(torch.tensor([[1.0, 2.0]]), torch.tensor([[0.0, 0.0]]))
    assert_close(loss, torch.tensor(1.25))  # 0.5 (1 + 4) / 2


def test_latent_regularisation_is_beta_times_the_divergence_from_a_unit_gaussian():
    loss = equations.latent_regularisation_loss(
        torch.tensor([[1.0, 0.0], [0.0, 0.0]]), torch.ones(2, 2), beta=0.1
    )
    assert_close(loss, torch.tensor(0.025))  # (1/2 + 0) / 2 windows, times 0.1


def test_the_latent_prior_follows_and_the_posterior_does_not_mind():
    loc, prior_loc = torch.tensor([[1.0]], requires_grad=True), torch.tensor([[3.0]], requires_grad=True)
    one = torch.ones(1, 1)
    loss = equations.latent_prior_loss(loc, one, prior_loc, one)
    assert_close(loss.detach(), torch.tensor(2.0))  # (1 - 3)^2 / 2
    loss.backward()
    assert loc.grad is None
    assert_close(prior_loc.grad, torch.tensor([[2.0]]))  # 3 - 1: downhill is towards the posterior


def test_prior_regularised_value():
    value = equations.prior_regularised_value(torch.tensor([3.0, 3.0]), torch.tensor([0.0, 4.0]), 0.5)
    assert_close(value, torch.tensor([3.0, 1.0]))


def test_alpha_rises_where_the_divergence_exceeds_its_target():
    log_alpha = torch.tensor(0.5, requires_grad=True)
    divergence = torch.tensor([7.0, 4.0], requires_grad=True)
    loss = equations.divergence_dual_loss(log_alpha, divergence, 5.0)
    assert_close(loss.detach(), torch.tensor([-1.0, 0.5]))  # 0.5 (5 - 7), 0.5 (5 - 4)
    loss[0].backward()
    assert_close(log_alpha.grad, torch.tensor(-2.0))  # descent raises it
    assert divergence.grad is None
