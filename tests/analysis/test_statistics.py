"""Statistics of experiments: numbers worked by hand, and SciPy's for the same data."""

import math

import numpy as np
import pytest
from scipy import stats

from tstar_rl.analysis import improvement_over_tasks, interquartile_interval, profile_over_tasks
from tstar_rl.analysis import statistics as ours
from tstar_rl.analysis.task_statistics import least_when_all_win


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_interquartile_mean_by_hand_and_by_scipy():
    assert ours.interquartile_mean([8.0, 1.0, 2.0, 100.0]) == 5.0  # 1 and 100 are cut
    assert ours.interquartile_mean([0.0, 0.0, 9.0]) == 3.0  # too few to cut
    # Ten values: two at either end are cut, of (10 x) 0..9 the rest is 2..7.
    assert ours.interquartile_mean(np.arange(10.0) * 10) == 45.0
    draws = rng().normal(size=(5, 13))
    np.testing.assert_allclose(ours.interquartile_mean(draws), stats.trim_mean(draws, 0.25, axis=1))
    with pytest.raises(ValueError, match="at least one value"):
        ours.interquartile_mean([])


def test_episodes_are_drawn_within_a_seed():
    # Two episodes, 0 and 1: the drawn mean is 0, 1/2, 1 with probability 1/4, 1/2, 1/4.
    chosen = np.zeros((40_000, 1), dtype=np.int64)
    draws = ours.resampled_means([[0.0, 1.0]], chosen, rng())
    shares = [float((draws == value).mean()) for value in (0.0, 0.5, 1.0)]
    assert shares == pytest.approx([0.25, 0.5, 0.25], abs=0.01)
    # The second seed alone is chosen, and all of its episodes are the same.
    np.testing.assert_allclose(ours.resampled_means([[0.0, 1.0], [0.3, 0.3]], chosen + 1, rng()), 0.3)


def test_one_seed_has_the_interval_of_its_episodes():
    episodes = np.repeat([0.0, 1.0], 200)
    found = interquartile_interval([[episodes]], rng())
    half = 1.96 * 0.5 / math.sqrt(400)  # of a mean of 400 coins
    assert found.value == 0.5
    assert (found.low, found.high) == pytest.approx((0.5 - half, 0.5 + half), abs=0.004)


def test_seeds_without_episode_noise_have_the_interval_of_scipys_bootstrap():
    values = np.array([0.61, 0.70, 0.74, 0.55, 0.81, 0.66, 0.90, 0.72, 0.69, 0.58])
    found = interquartile_interval([[[value] * 4 for value in values]], rng(), 20_000)
    theirs = stats.bootstrap(
        (values,),
        lambda x, axis: stats.trim_mean(x, 0.25, axis=axis),
        n_resamples=20_000,
        method="percentile",
        random_state=1,
    ).confidence_interval
    assert found.value == pytest.approx(stats.trim_mean(values, 0.25))
    assert (found.low, found.high) == pytest.approx((theirs.low, theirs.high), abs=0.004)


def test_probability_of_improvement_by_hand_and_by_mann_whitney():
    # Of six pairs (1, 2) x (0, 1, 3): 1 > 0, 2 > 0, 2 > 1, and 1 = 1 counts half.
    assert ours.probability_of_improvement([1, 2], [0, 1, 3]) == pytest.approx(3.5 / 6)
    generator = rng()
    x, y = generator.integers(0, 6, 11), generator.integers(1, 7, 8)  # with ties
    theirs = stats.mannwhitneyu(x, y).statistic / (len(x) * len(y))
    assert ours.probability_of_improvement(x, y) == pytest.approx(theirs)


def test_means_of_thirds_that_tie_are_ties():
    drawn = ours.resampled_means([[0.0, 1 / 3, 2 / 3, 1.0] * 5], np.zeros((20_000, 1), int), rng())
    assert len(np.unique(drawn)) <= 61  # of twenty thirds; by the order of the sum there would be more


def test_interval_of_the_probability_of_improvement():
    low, high = [[0.1], [0.2], [0.3]], [[0.7], [0.8], [0.9]]
    assert improvement_over_tasks([high], [low], rng()) == (1.0, least_when_all_win(3, 3), 1.0)
    same = improvement_over_tasks([low], [low], rng())
    assert same.value == 0.5 and same.low < 0.2 and same.high > 0.8


def test_performance_profile_by_hand():
    assert ours.performance_profile([0.2, 0.5, 0.9, 0.9], [0.0, 0.5, 0.89, 0.9]).tolist() == [1, 0.5, 0.5, 0]
    profile, low, high = profile_over_tasks([[[0.2], [0.5], [0.9], [0.9]]], [0.0, 0.5, 0.95], rng())
    assert profile.tolist() == [1, 0.5, 0]
    # Of four drawn seeds, how many lie above 0.5 is binomial: none or all with probability 1/16 > 2.5%.
    assert low.tolist() == [1, 0, 0] and high.tolist() == [1, 1, 0]


def test_the_same_generator_gives_the_same_interval():
    scores = [[np.repeat([0.0, 1.0], [n, 199 - n]) for n in (30, 81, 113)]]
    assert interquartile_interval(scores, rng()) == interquartile_interval(scores, rng())
    assert interquartile_interval(scores, rng()) != interquartile_interval(scores, np.random.default_rng(1))


@pytest.mark.parametrize(
    "statistic",
    [
        ours.interquartile_mean,
        lambda values: ours.probability_of_improvement(values, [0.5]),
        lambda values: ours.probability_of_improvement([0.5], values),
        lambda values: ours.performance_profile(values, [0.5]),
        lambda values: improvement_over_tasks([[values]], [[[1.0]]], rng()),
        lambda values: interquartile_interval([values], rng()),
    ],
)
def test_what_is_no_number_is_refused_and_not_left_out_or_counted_as_a_loss(statistic):
    for value in (np.nan, np.inf):
        with pytest.raises(ValueError, match=f"statistics need finite numbers, got {value}"):
            statistic([0.1, value, 0.3, 0.4])


def test_an_interval_of_no_resamples_is_refused():
    with pytest.raises(ValueError, match="at least one resample, got none"):
        interquartile_interval([[[0.1, 0.3]]], rng(), resamples=0)


def test_no_seed_or_no_episode_is_refused():
    for scores in ([], [[]]):
        with pytest.raises(ValueError, match="at least one seed, and at least one episode"):
            improvement_over_tasks([scores], [[[1.0]]], rng())
