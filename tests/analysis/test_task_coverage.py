"""How often intervals over several tasks hold the true value, on made-up data: the figures of decision 0017."""

import numpy as np
import pytest
from scipy import stats

from tstar_rl.analysis import statistics
from tstar_rl.analysis import task_statistics as ours


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


@pytest.mark.slow
@pytest.mark.parametrize(("seeds", "expected"), [(3, 0.85), (10, 0.92)])
def test_how_often_an_interval_holds_the_true_value(seeds, expected):
    """The figures of decision 0017: seven tasks, 400 episodes of four subtasks, seeds that deviate by .08."""
    generator, tasks, repetitions = rng(), np.linspace(0.45, 0.9, 7), 300

    def drawn() -> list[list[np.ndarray]]:
        chances = np.clip(tasks[:, None] + generator.normal(0, 0.08, (7, seeds)), 0.02, 0.98)
        return [[generator.binomial(4, chance, 400) / 4 for chance in task] for task in chances]

    means = [np.concatenate([statistics.seed_means(task) for task in drawn()]) for _ in range(repetitions)]
    truth = statistics.interquartile_mean(means).mean()
    found = [ours.interquartile_interval(drawn(), generator, 400) for _ in range(repetitions)]
    held = np.mean([each.low <= truth <= each.high for each in found])
    assert held == pytest.approx(expected, abs=0.06)  # three deviations of a share of 300


FAR = (np.linspace(0.45, 0.9, 7), 0.08, 0.03, 400)
NEAR = (np.full(9, 0.985), 0.006, 0.005, 200)
"""Levels of tasks, deviation of seeds, gain, episodes."""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("made_up", "seeds", "draw", "expected", "above", "middle"),
    [
        (FAR, 3, statistics.drawn_means, 0.95, 0.03, -0.008),
        (FAR, 3, statistics.drawn_seeds, 0.93, 0.03, -0.008),
        (FAR, 10, statistics.drawn_means, 0.95, 0.02, -0.002),
        (FAR, 10, statistics.drawn_seeds, 0.95, 0.03, -0.001),
        (NEAR, 3, statistics.drawn_means, 0.96, 0.03, -0.024),
        (NEAR, 3, statistics.drawn_seeds, 0.94, 0.03, -0.010),
    ],
)
def test_how_often_the_interval_of_an_improvement_holds_the_true_value(
    made_up, seeds, draw, expected, above, middle
):
    """The table of decision 0017."""
    (levels, deviation, gain, episodes), generator, repetitions = made_up, rng(), 300

    def drawn(level: float, number: int) -> list[np.ndarray]:
        chances = np.clip(level + generator.normal(0, deviation, number), 0.01, 1)
        return [generator.binomial(4, chance, episodes) / 4 for chance in chances]

    def true_value(level: float) -> float:
        better, other = (statistics.seed_means(drawn(each, 3_000)) for each in (level + gain, level))
        return stats.mannwhitneyu(better, other).statistic / 9e6

    truth = np.mean([true_value(level) for level in levels])
    found = [
        ours.improvement_over_tasks(
            *([drawn(level + more, seeds) for level in levels] for more in (gain, 0.0)), generator, 400, draw
        )
        for _ in range(repetitions)
    ]
    held = np.mean([each.low <= truth <= each.high for each in found])
    assert held == pytest.approx(expected, abs=0.05)
    assert np.mean([truth > each.high for each in found]) == pytest.approx(above, abs=0.04)
    assert np.mean([(each.low + each.high) / 2 - each.value for each in found]) == pytest.approx(
        middle, abs=0.006
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("chances", "expected"),
    [((0.95, 0.05), 1.0), ((0.98, 0.02), 1.0), ((0.9, 0.5), 0.97), ((0.5, 0.5), 0.94)],
)
def test_how_often_it_holds_where_some_tasks_are_all_won_and_some_all_lost(chances, expected):
    """Of nine tasks six have the first chance and three the second; with .9 and .5 five and four. Decision 0017."""
    first = 5 if chances == (0.9, 0.5) else 6
    true, generator = np.repeat(chances, (first, 9 - first)), rng()

    def drawn(shift: float) -> list[list[float]]:
        return [[score] for score in generator.normal(shift, 1, 3)]

    found = [
        ours.improvement_over_tasks(
            [drawn(shift) for shift in stats.norm.ppf(true) * 2**0.5],
            [drawn(0.0) for _ in true],
            rng(),
            2_000,
            statistics.drawn_seeds,
        )
        for _ in range(250)
    ]
    held = np.mean([each.low <= true.mean() <= each.high for each in found])
    assert held == pytest.approx(expected, abs=0.04)
