"""The equations of the signals beyond the paper's, on numbers worked by hand."""

import math

import pytest
import torch
from torch.testing import assert_close

from tstar_rl import signal_equations as equations


def test_feasibility_is_a_probability():
    logits = torch.tensor([0.0, math.log(3.0), -math.log(3.0)])
    assert_close(equations.feasibility(logits), torch.tensor([0.5, 0.75, 0.25]))  # odds 1, 3 and 1/3


def test_outcome_loss_of_failures_successes_and_shares():
    # F = .75 of a success costs -ln .75, of a failure -ln .25; of a share of .5 the mean of both.
    logit = torch.full((1,), math.log(3.0))
    for outcome, cost in (
        (1.0, -math.log(0.75)),
        (0.0, -math.log(0.25)),
        (0.5, -0.5 * math.log(0.75 * 0.25)),
    ):
        assert_close(equations.outcome_loss(logit, torch.tensor([outcome])), torch.tensor(cost))


@pytest.mark.parametrize("share", [0.2, 0.75])
def test_outcome_loss_is_least_at_the_mean_outcome(share):
    logits = torch.linspace(-3, 3, 601)
    costs = torch.stack([equations.outcome_loss(x, torch.tensor(share)) for x in logits])
    assert equations.feasibility(logits[costs.argmin()]).item() == pytest.approx(share, abs=0.005)


def test_starts_are_drawn_by_expected_failure():
    # Failures of .2, .8 and 0, with the sum 1; half of the draws are by failure, a third of the others each.
    expected = torch.tensor([0.8, 0.2, 1.0])
    weights = equations.start_weights(expected, 0.5)
    assert_close(weights, torch.tensor([1 / 6 + 0.1, 1 / 6 + 0.4, 1 / 6]))
    assert_close(equations.start_weights(expected, 0.0), torch.full((3,), 1 / 3))
    assert_close(equations.start_weights(torch.ones(4), 1.0), torch.full((4,), 0.25))  # no failure expected


def test_remaining_share_looks_ahead():
    # Three skills are left. A failure: none is done. A success and half of the two after it: (1 + 1) / 3.
    succeeded, later = torch.tensor([0.0, 1.0, 1.0, 1.0]), torch.tensor([0.9, 0.5, 0.0, 1.0])
    expected = torch.tensor([0.0, 2 / 3, 1 / 3, 1.0])
    assert_close(equations.remaining_share(succeeded, later, 3), expected)
    assert_close(equations.remaining_share(succeeded, later, 1), succeeded)  # nothing comes after the last


def test_temporal_difference_of_a_step_and_of_the_last_one():
    reward, value, then = torch.tensor([1.0, 1.0]), torch.tensor([2.0, 2.0]), torch.tensor([4.0, 4.0])
    error = equations.temporal_difference(reward, value, then, torch.tensor([False, True]), 0.5)
    assert_close(
        error, torch.tensor([1.0, -1.0])
    )  # 1 + 2 - 2, and 1 - 2: what follows the end is worth nothing


def test_a_value_counts_as_far_as_its_critic_is_sure():
    value = torch.tensor([0.8, 0.8, 0.8, 1.5, -0.5, 0.8])
    squared_error = torch.tensor([0.0, 0.125, 0.5, 0.0, 0.0, -0.3])
    # alpha 4: weights 1, 1 - .5, 1 - min(2, 1), 1, 1, and 1 where the prediction of a square is negative
    found = equations.hand_over_value(value, squared_error, 4.0)
    assert_close(found, torch.tensor([0.8, 0.4, 0.0, 1.0, 0.0, 0.8]))


def test_proximity_falls_by_the_step_and_is_nothing_before_a_bad_hand_over():
    left = torch.tensor([0, 1, 2, 0, 1])
    good = torch.tensor([True, True, True, False, False])
    found = equations.proximity_target(left, good, 0.5)
    assert_close(found, torch.tensor([1.0, 0.5, 0.25, 0.0, 0.0]))


def test_proximity_pays_the_way_and_the_end():
    p = torch.tensor([0.25, 0.25, -1.0, 0.5])
    then = torch.tensor([0.5, 0.5, 0.5, 3.0])
    ended = torch.tensor([False, True, False, True])
    # Differences .25, .25, .5 - 0 and 1 - .5 after clipping; the ends add .5 and 1.
    assert_close(equations.proximity_reward(p, then, ended), torch.tensor([0.25, 0.75, 0.5, 1.5]))
    # Over an episode the way adds up to its ends: 2 P(s_T) - P(s_0).
    path = torch.tensor([0.1, 0.7, 0.3, 0.9])
    paid = equations.proximity_reward(path[:-1], path[1:], torch.tensor([False, False, True]))
    assert float(paid.sum()) == pytest.approx(2 * 0.9 - 0.1)


def test_squared_error_loss_is_a_mean():
    loss = equations.squared_error_loss(torch.tensor([1.0, 0.0]), torch.tensor([0.0, 2.0]))
    assert_close(loss, torch.tensor(2.5))


def test_both_sides_of_a_skill_count_half():
    sides = [torch.tensor(3.0), torch.tensor(1.0)]
    assert_close(equations.two_sided_loss(sides), torch.tensor(2.0))
    assert_close(equations.two_sided_loss(sides[:1]), torch.tensor(1.5))  # the first skill has one side
