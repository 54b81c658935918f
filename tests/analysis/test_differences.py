"""Differences of arms and corrected p-values: numbers worked by hand, and SciPy's for the same data."""

import math

import numpy as np
import pytest
from scipy import stats

from tstar_rl.analysis.differences import (
    difference_of,
    holm,
    outer_ends,
    paired_difference,
    signed_interval,
    student_half,
)


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_paired_difference_by_hand():
    # Differences .1, .2, .3: mean .2, deviation .1, t of two degrees 4.3027: half .1 x 4.3027 / sqrt(3) = .2484.
    first = {3: [0.6], 4: [0.9], 5: [0.7], 9: [0.0]}
    second = {5: [0.4], 4: [0.7], 3: [0.5], 8: [1.0]}
    found = paired_difference(first, second, rng())
    assert found.value == pytest.approx(0.2) and found.seeds == 3
    assert found.t_half == pytest.approx(0.2484, abs=1e-4)
    assert (found.low, found.high) == pytest.approx((0.1, 0.3))  # each with 1/27 > 2.5%
    theirs = stats.ttest_rel([0.6, 0.9, 0.7], [0.5, 0.7, 0.4]).confidence_interval()
    assert found.value + found.t_half == pytest.approx(theirs.high)
    assert found.p_value == pytest.approx(stats.ttest_rel([0.6, 0.9, 0.7], [0.5, 0.7, 0.4]).pvalue)
    # The bootstrap of three seeds is too narrow, so Student's t decides.
    assert found.low > 0 and found.verdict() == "no clear difference"


def test_pairs_stay_together():
    # The arms go up and down together from seed to seed: unpaired, nothing could be told.
    first = {seed: [seed + 0.1] for seed in range(5)}
    second = {seed: [float(seed) + 0.01 * (seed == 2)] for seed in range(5)}
    found = paired_difference(first, second, rng())
    assert (found.low, found.high) == pytest.approx((0.1, 0.1), abs=0.01) and found.verdict() == "higher"
    assert found.p_value < 1e-5
    alike = paired_difference(first, {seed: [float(seed)] for seed in range(5)}, rng())
    assert (alike.low, alike.high) == pytest.approx((0.1, 0.1)) and alike.verdict() == "no spread"
    six = paired_difference(*({seed: [value] for seed in range(6)} for value in (0.3, 0.2)), rng())
    assert (six.t_half, six.p_value, six.verdict()) == (0.0, pytest.approx(1 / 32), "higher")
    assert paired_difference(second, first, rng()).verdict() == "lower"
    same = paired_difference(first, first, rng())
    assert (same.value, same.p_value) == (0.0, 1.0)


def test_a_difference_of_one_seed_is_that_of_its_episodes():
    first, second = {0: np.repeat([0.0, 1.0], [40, 60])}, {0: np.repeat([0.0, 1.0], [60, 40])}
    found = paired_difference(first, second, rng())
    half = 1.96 * math.sqrt(2 * 0.24 / 100)
    assert math.isnan(found.t_half) and math.isnan(found.p_value) and found.verdict() == "one seed"
    assert (found.low, found.high) == pytest.approx((0.2 - half, 0.2 + half), abs=0.012)
    with pytest.raises(ValueError, match=r"no seed in common: \[0\] and \[1\]"):
        paired_difference(first, {1: [1.0]}, rng())


def test_holm_by_hand():
    # Sorted .01 .02 .03 .04, times 4 3 2 1: .04 .06 .06 .04; none below the one before it.
    assert holm([0.03, 0.01, 0.04, 0.02]) == pytest.approx([0.06, 0.04, 0.06, 0.06])
    assert holm([0.4, 0.9]) == pytest.approx([0.8, 0.9]) and holm([0.7, 0.9, 0.8]).max() == 1.0
    assert holm([0.2]) == pytest.approx([0.2]) and len(holm([])) == 0


def test_a_few_equal_values_have_no_students_interval_and_many_have_one_of_no_width():
    """The same rule wherever one stands: `difference_of` says of arms that did the same that they did."""
    assert math.isnan(student_half(np.full(5, 0.3))) and student_half(np.full(6, 0.3)) == 0
    assert math.isnan(student_half(np.zeros(3))) and student_half(np.array([0.3, 0.3, 0.4])) > 0
    found = difference_of(np.zeros(3), np.zeros(10))
    assert (found.t_half, found.p_value, found.verdict()) == (0.0, 1.0, "no clear difference")


def test_ends_are_those_of_the_wider_interval_and_no_interval_is_shown_as_none():
    assert outer_ends(0.2, 0.1, 0.25, 0.15) == pytest.approx((0.05, 0.35))
    assert outer_ends(0.2, 0.0, 0.5, 0.15) == (0.0, 0.5)
    assert outer_ends(0.2, 0.1, 0.25, math.nan) == (0.1, 0.25)  # one seed: of its episodes
    alike = difference_of(np.full(3, 0.25), np.full(10, 0.25))
    assert alike.verdict() == "no spread"
    assert signed_interval(alike.value, *outer_ends(*alike[:4])) == "+0.250"
    same = difference_of(np.zeros(3), np.zeros(10))
    assert signed_interval(same.value, *outer_ends(*same[:4])) == "+0.000 [+0.000, +0.000]"
