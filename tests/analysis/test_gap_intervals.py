"""The hand-over gap of one chain, on numbers worked by hand."""

import numpy as np
import pytest

from tstar_rl.analysis.hand_over_gap import chain_interval, gap_interval, product_interval


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_product_and_gap_are_what_the_hand_finds():
    assert product_interval([100, 50], 100, rng()).value == pytest.approx((1.0 + 0.5) / 2)
    assert chain_interval([1.0, 0.0, 0.5, 0.5], rng()).value == 0.5
    assert gap_interval([100, 50], 100, [1.0, 0.0, 0.5, 0.5], rng()).value == pytest.approx(0.25)


def test_an_interval_of_a_share_is_as_wide_as_the_binomial_says():
    """One skill, .8 of 400: the deviation is .02."""
    found = product_interval([320], 400, rng(), 20_000)
    assert found.low == pytest.approx(0.8 - 1.96 * 0.02, abs=0.003)
    assert found.high == pytest.approx(0.8 + 1.96 * 0.02, abs=0.003)
    episodes = np.repeat([0.0, 1.0], [80, 320])
    assert chain_interval(episodes, rng(), 20_000).low == pytest.approx(found.low, abs=0.003)


def test_an_interval_of_a_product_is_around_it():
    found = product_interval([80, 50, 50], 100, rng())
    assert found.value == pytest.approx((0.8 + 0.4 + 0.2) / 3) and found.low < found.value < found.high
    # The deviation: of .8 by .04 x (1 + .5 + .25) / 3, of either .5 by .05 x (.8 + .4) / 3 and .05 x .4 / 3.
    deviation = np.sqrt((0.04 * 1.75 / 3) ** 2 + (0.05 * 1.2 / 3) ** 2 + (0.05 * 0.4 / 3) ** 2)
    assert (found.high - found.low) / 2 == pytest.approx(1.96 * deviation, rel=0.05)


def test_a_gap_is_as_unsure_as_both_of_its_sides():
    """Deviations .02 and .03 of 400 and 250 episodes make .036."""
    chain = np.repeat([0.0, 1.0], [86, 164])
    found = gap_interval([320], 400, chain, rng(), 20_000)
    deviation = np.hypot(0.02, np.sqrt(0.656 * 0.344 / 250))
    assert (found.high - found.low) / 2 == pytest.approx(1.96 * deviation, rel=0.05)


def test_skills_that_never_failed_may_still_fail():
    """Of one that succeeded in all of 50 episodes Jeffreys' 2.5% quantile is that of Beta(50.5, .5), .951."""
    found = product_interval([50], 50, rng(), 20_000)
    assert found.value == found.high == 1.0 and found.low == pytest.approx(0.951, abs=0.002)
    gap = gap_interval([10, 10], 10, np.ones(5), rng())
    assert gap.value == gap.high == 0.0 and -0.4 < gap.low < -0.1


def test_no_episodes_are_refused():
    with pytest.raises(ValueError, match="at least one episode"):
        chain_interval([], rng())
    with pytest.raises(ValueError, match="at least one episode, got 0"):
        product_interval([1], 0, rng())
