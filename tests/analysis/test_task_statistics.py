"""Statistics over several tasks: numbers worked by hand, and SciPy's for the same data."""

import numpy as np
import pytest
from scipy import stats

from tstar_rl.analysis import statistics
from tstar_rl.analysis import task_statistics as ours

UNEQUAL = [[[0.0], [0.4]], [[0.2], [0.6], [0.8], [1.0]]]
"""Two tasks, of two seeds and of four; a seed's episodes are all the same."""


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def made_up(*seeds: int) -> list[list[list[float]]]:
    """Tasks of so many seeds, without noise of episodes."""
    generator = rng()
    return [[[value] * 2 for value in generator.uniform(0.1 * task, 1, n)] for task, n in enumerate(seeds)]


def values(strata) -> list[np.ndarray]:
    """(seeds,) of each task."""
    return [np.array([episodes[0] for episodes in scores]) for scores in strata]


def test_weights_give_every_task_the_same():
    assert ours.equal_weights([2, 3]).tolist() == [3, 3, 2, 2, 2]
    assert ours.equal_weights([3, 3]).tolist() == [1] * 6
    weights = ours.equal_weights([3, 10, 4])
    assert [part.sum() for part in np.split(weights, [3, 13])] == [60, 60, 60]
    for seeds in ([], [3, 0]):
        with pytest.raises(ValueError, match="at least one task, and a seed of each"):
            ours.equal_weights(seeds)


def test_weighted_interquartile_mean_by_hand_and_by_scipy():
    # Eight copies 0 0 .2 .4 .4 .6 .8 1, two cut at either end: (.2 + .4 + .4 + .6) / 4. Unweighted it were .5.
    assert ours.weighted_interquartile_mean(
        [0.4, 0.0, 0.2, 0.6, 0.8, 1.0], [2, 2, 1, 1, 1, 1]
    ) == pytest.approx(0.4)
    # Of nine copies two are cut at either end: three of the five ones stay, and two of the four fours.
    assert ours.weighted_interquartile_mean([1.0, 4.0], [5, 4]) == pytest.approx((3 * 1 + 2 * 4) / 5)
    draws, weights = rng().normal(size=(5, 7)), np.array([1, 4, 2, 2, 3, 1, 2])
    theirs = stats.trim_mean(np.repeat(draws, weights, axis=1), 0.25, axis=1)
    np.testing.assert_allclose(ours.weighted_interquartile_mean(draws, weights), theirs)
    plain = statistics.interquartile_mean(draws)
    np.testing.assert_allclose(ours.weighted_interquartile_mean(draws, np.ones(7)), plain)


def test_where_every_seed_wins_the_interval_is_newcombes():
    """Of one seed each N is 0: 1 - p = z^2 p. Of ten, worked by hand, p is .80: .20 = .0384 x .80 x (1 + 9 x .611)."""
    assert ours.least_when_all_win(1, 1) == pytest.approx(1 / (1 + 1.959964**2))
    assert ours.least_when_all_win(10, 10) == pytest.approx(0.80, abs=0.001)
    high, low = [[0.9] * 4] * 10, [[0.1] * 4] * 10
    least = ours.least_when_all_win(10, 10)
    assert ours.improvement_over_tasks([high], [low], rng()) == (1.0, least, 1.0)
    assert ours.improvement_over_tasks([low], [high], rng()) == (0.0, 0.0, 1 - least)
    both = ours.improvement_over_tasks([high, high[:1]], [low, low[:1]], rng())
    assert both.low == pytest.approx(1 - np.hypot(1 - least, 1 - ours.least_when_all_win(1, 1)) / 2)
    mixed = ours.improvement_over_tasks([high, low, high], [low, high, low], rng())
    assert mixed.value == pytest.approx(2 / 3)  # two tasks may be less sure of 1, one of 0
    assert mixed.low == pytest.approx(2 / 3 - 2**0.5 * (1 - least) / 3)
    assert mixed.high == pytest.approx(2 / 3 + (1 - least) / 3)


def test_tasks_of_more_seeds_do_not_weigh_more():
    assert ours.interquartile_interval(UNEQUAL, rng()).value == pytest.approx(0.4)
    doubled = [[*UNEQUAL[0], *UNEQUAL[0]], UNEQUAL[1]]
    assert ours.interquartile_interval(doubled, rng()).value == pytest.approx(0.4)


def test_tasks_are_strata():
    # Within each task all seeds agree, so nothing is left to chance; drawn over both tasks it would be.
    tasks = [[[0.2], [0.2], [0.2], [0.2]], [[0.8], [0.8], [0.8], [0.8]]]
    assert ours.interquartile_interval(tasks, rng()) == pytest.approx((0.5, 0.5, 0.5))
    mixed = ours.interquartile_interval([[*tasks[0], *tasks[1]]], rng())
    assert mixed.low < 0.3 and mixed.high > 0.7
    band = ours.profile_over_tasks(tasks, [0.1, 0.5, 0.9], rng())
    assert [line.tolist() for line in band] == [[1, 0.5, 0]] * 3


@pytest.mark.parametrize("seeds", [(4, 4, 4), (3, 10, 5)])
def test_the_interval_is_that_of_scipys_stratified_bootstrap(seeds):
    strata, weights = made_up(*seeds), ours.equal_weights(seeds)
    theirs = stats.bootstrap(  # of several samples, each is drawn by itself
        values(strata),
        lambda *tasks, axis: stats.trim_mean(
            np.repeat(np.concatenate(tasks, -1), weights, -1), 0.25, axis=axis
        ),
        n_resamples=20_000,
        method="percentile",
        random_state=1,
    ).confidence_interval
    found = ours.interquartile_interval(strata, rng(), 20_000)
    assert (found.low, found.high) == pytest.approx((theirs.low, theirs.high), abs=0.006)


def test_episodes_are_drawn_within_their_seed():
    # One seed of each of two tasks, 200 coins each: the mean of two means of 200 coins is one of 400.
    strata = [[np.repeat([0.0, 1.0], 100)]] * 2
    half = 1.96 * 0.5 / 400**0.5
    found = ours.interquartile_interval(strata, rng())
    assert found.value == 0.5 and (found.low, found.high) == pytest.approx(
        (0.5 - half, 0.5 + half), abs=0.004
    )


def test_improvement_is_a_mean_over_tasks():
    # First task: of (1, 2) x (0, 1, 3) three wins and a tie, 3.5 / 6. Second: 1 x 0, a win. Their mean is 9.5 / 12.
    first, second = [[[1.0], [2.0]], [[1.0]]], [[[0.0], [1.0], [3.0]], [[0.0]]]
    found = ours.improvement_over_tasks(first, second, rng())
    assert found.value == pytest.approx(9.5 / 12)
    # In the first nothing is won if the other draws 3, 3, 3, and all if 0, 0, 0: 1/27 > 2.5%. The second is sure of 1
    # as far as the bootstrap says; Newcombe's of one seed each is 1 / (1 + 1.96^2), which is .793 below 1.
    assert (found.low, found.high) == (
        pytest.approx(9.5 / 12 - np.hypot(3.5 / 6, 0.79345) / 2, abs=1e-5),
        1.0,
    )
    assert ours.improvement_over_tasks(second, first, rng()).value == pytest.approx(2.5 / 12)


def test_improvement_by_mann_whitney_and_by_scipys_stratified_bootstrap():
    first, second = made_up(4, 9), [[[v - 0.1 for v in seed] for seed in task] for task in made_up(5, 6)]

    def theirs(a, b, c, d, axis=-1):
        wins = [
            stats.mannwhitneyu(x, y, axis=axis).statistic / (x.shape[axis] * y.shape[axis])
            for x, y in ((a, b), (c, d))
        ]
        return np.mean(wins, axis=0)

    samples = [task for pair in zip(values(first), values(second), strict=True) for task in pair]
    found = ours.improvement_over_tasks(first, second, rng(), 20_000)
    assert found.value == pytest.approx(theirs(*samples))
    interval = stats.bootstrap(
        samples, theirs, n_resamples=4_000, method="percentile", random_state=1
    ).confidence_interval
    assert (found.low, found.high) == pytest.approx((interval.low, interval.high), abs=0.03)


def test_the_profile_is_a_mean_over_tasks():
    # Above .5: none of two, and three of four. Above 0 and below: one of two, and all.
    shares, low, high = ours.profile_over_tasks(UNEQUAL, [0.0, 0.5], rng())
    assert shares.tolist() == [0.75, 0.375]
    # Above 0 only the first task's two seeds vary: 0, 1 or 2 of them, each end with probability 1/4.
    assert (low[0], high[0]) == (0.5, 1.0) and low[1] < 0.375 < high[1]
    strata, thresholds = made_up(4, 9, 5), np.linspace(0, 1, 11)
    theirs = [stats.ecdf(task).sf.evaluate(thresholds) for task in values(strata)]
    np.testing.assert_allclose(ours.profile_over_tasks(strata, thresholds, rng())[0], np.mean(theirs, axis=0))


def test_one_task_has_the_interquartile_mean_of_its_seeds():
    (one,) = made_up(6)
    mean = statistics.interquartile_mean(np.concatenate(values([one])))
    assert ours.interquartile_interval([one], rng()).value == pytest.approx(mean, abs=1e-12)


def test_no_task_and_other_tasks_are_refused():
    with pytest.raises(ValueError, match="at least one task"):
        ours.interquartile_interval([], rng())
    with pytest.raises(ValueError, match="at least one seed, and at least one episode"):
        ours.interquartile_interval([[[]]], rng())
    with pytest.raises(ValueError, match="at least one task"):
        ours.profile_over_tasks([], [0.5], rng())
    with pytest.raises(ValueError, match="both arms need the same tasks, and at least one; got 2 and 1"):
        ours.improvement_over_tasks(UNEQUAL, UNEQUAL[:1], rng())
