"""Success on either side of one number, on heaps that are known."""

import math

import torch

from tstar_rl.seams.two_sides import two_sides


def test_two_heaps_are_parted_and_each_has_its_own_success():
    values = torch.tensor([2.1, -0.3, 2.2, -0.2, 2.0, -0.4, 2.1, 2.3])
    outcomes = torch.tensor([True, False, True, True, True, False, False, True])
    found = two_sides(values, outcomes)
    assert math.isclose(found.split, (-0.2 + 2.0) / 2, rel_tol=1e-6)
    assert found.below == 3 / 8
    assert math.isclose(found.succeeded_below, 1 / 3)
    assert found.succeeded_above == 4 / 5


def test_outcomes_do_not_move_the_split():
    values = torch.cat([torch.linspace(-1, 0, 50), torch.linspace(5, 6, 10)])
    splits = {two_sides(values, torch.arange(60) % number == 0).split for number in (2, 3, 7)}
    assert splits == {2.5}


def test_one_heap_of_equal_numbers_and_too_few_have_no_sides():
    for number in (0, 1, 5):
        found = two_sides(torch.ones(number), torch.ones(number, dtype=torch.bool))
        assert all(math.isnan(value) for value in found)


def test_equal_numbers_stay_on_one_side():
    found = two_sides(torch.tensor([0.0, 0.0, 0.0, 1.0]), torch.tensor([True, False, True, True]))
    assert found.below == 0.75 and found.split == 0.5
