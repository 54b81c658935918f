"""Answers over tasks: the comparison of two arms by hand, and the rule declared with a question."""

import numpy as np
import pandas as pd
import pytest

from tstar_rl.analysis.task_questions import (
    TaskQuestion,
    answer_over_tasks,
    compare_over_tasks,
    paired_runs,
    sign_test,
)
from tstar_rl.analysis.task_statistics import least_when_all_win


def arms(first: dict[int, float], second: dict[int, float]) -> dict:
    """Scores of two arms on one task: every episode of a seed has its progress."""
    return {
        name: {seed: np.full(4, value) for seed, value in seeds.items()}
        for name, seeds in (("a", first), ("b", second))
    }


def test_two_arms_over_tasks_by_hand():
    scores = {
        "won": arms({1: 0.9, 2: 0.8}, {1: 0.5, 2: 0.6}),
        "tied": arms({1: 0.7}, {1: 0.7}),
        "lost": arms({1: 0.2, 2: 1.0}, {1: 0.4, 3: 0.0}),  # seed 1 alone is of both
        "apart": arms({1: 0.0}, {1: 1.0}),
    }
    (row,) = compare_over_tasks(scores, ["won", "tied", "lost"], [("a", "b"), ("a", "c")]).itertuples()
    assert (row.first, row.second, row.tasks, row.ahead, row.behind) == ("a", "b", 3, 1, 1)
    assert paired_runs(scores, "a", "b") == 5 and paired_runs(scores, "a", "c") == 0
    # A bootstrap is certain of each task; of 1, won by two seeds of two, and of 0, lost by one of one, no one can be.
    ends = 0.5 - (1 - least_when_all_win(2, 2)) / 3, 0.5 + (1 - least_when_all_win(1, 1)) / 3
    assert row.improvement == pytest.approx((1 + 0.5 + 0) / 3)
    assert (row.improvement_low, row.improvement_high) == pytest.approx(ends)
    assert (row.seeds_low, row.seeds_high) == pytest.approx(ends)
    both = compare_over_tasks(
        {"won": scores["won"]} | {str(n): scores["won"] for n in range(5)}, list("01234"), [("a", "b")]
    )
    assert both["ahead"].item() == 5
    assert compare_over_tasks(scores, [], [("a", "b")]).empty


def test_sign_test_by_hand():
    assert sign_test(5, 5) == pytest.approx(2 / 32)
    assert sign_test(1, 3) == pytest.approx(1.0)  # 1 or fewer, or 2 or more
    assert sign_test(8, 9) == pytest.approx(2 * (9 + 1) / 512)


def test_the_interval_of_seeds_alone_has_no_noise_of_episodes():
    """All seeds agree, so nothing is left to chance but episodes, and seeds alone give what nothing but wins does."""
    coins = {name: np.repeat([0.0, 1.0], n) for name, n in (("a", [40, 60]), ("b", [45, 55]))}
    scores = {"task": {name: dict.fromkeys(range(3), values) for name, values in coins.items()}}
    (row,) = compare_over_tasks(scores, ["task"], [("a", "b")]).itertuples()
    assert (row.improvement, row.seeds_low, row.seeds_high) == (1.0, least_when_all_win(3, 3), 1.0)
    assert row.improvement_low < row.seeds_low - 0.1


def row(value=0.8, low=0.6, high=0.9, ahead=8, behind=1, tasks=9, seeds=()) -> dict:
    ends = {"improvement": value, "improvement_low": low, "improvement_high": high}
    ends |= dict(zip(("seeds_low", "seeds_high"), seeds or (low, high), strict=True))
    return {
        "first": "a",
        "second": "b",
        "tasks": tasks,
        "ahead": ahead,
        "behind": behind,
        **ends,
    }


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (row(), "yes"),
        (row(ahead=7), "not decided; ahead on 7 of 9 tasks, where 8 are asked"),
        (row(ahead=1), "not decided; ahead on 1 of 9 tasks, where 8 are asked"),
        (row(0.6, 0.52, 0.72, ahead=6), "no, or not by much"),
        (
            row(ahead=5, tasks=5),
            "not decided; ahead on 5 of 5 tasks, of which no number suffices",
        ),
        # Seeds can still show that it is not by much: (.15 / .05) ** 2 x 2.043. No seeds make the signs suffice.
        (
            row(0.7, 0.48, 0.85, ahead=5, tasks=5),
            "not decided; ahead on 5 of 5 tasks, of which no number suffices; 18.4 times as many seeds probably would",
        ),
        (row(0.55, 0.45, 0.7), "no, or not by much"),
        (row(0.2, 0.1, 0.3, behind=8), "no: it does worse"),
        (row(0.2, 0.1, 0.3, ahead=8, behind=7), "no, or not by much"),
        (row(0.2, 0.1, 0.6, ahead=0, behind=9), "no, or not by much"),
        (
            row(0.62, 0.48, 0.72, ahead=4, seeds=(0.51, 0.76)),
            "no, or not by much (of seeds alone: not decided; ahead on 4 of 9 tasks, where 8 are asked; 2.4 times as "
            "many seeds probably would)",  # (.14 / .13) ** 2 x 2.043
        ),
        (row(0.6, 0.4, 0.8, seeds=(0.39, 0.81)), "not decided; 3.7 times as many seeds probably would"),
        # .1 from .5 with a lower half of .2: 4 x 2.043 times the seeds, with 2.043 = ((1.960 + .842) / 1.960) ** 2; .15
        # from the margin with an upper half of .2: 1.778 x 2.043.
        (row(0.6, 0.4, 0.8), "not decided; 3.7 times as many seeds probably would"),
        (
            row(0.7, 0.45, 0.8),
            "not decided; 3.2 times as many seeds probably would",
        ),  # (.25 / .2) ** 2 x 2.043
    ],
)
def test_an_answer_follows_the_interval_and_the_signs(found, expected):
    question = TaskQuestion("Does a help?", ("a", "b"), runs=10)
    assert answer_over_tasks(question, pd.DataFrame([found]), runs=10) == expected
    assert answer_over_tasks(question, pd.DataFrame([found]), runs=9) == "measured so far: 9 of 10 runs"


def test_a_pair_that_was_not_run_is_being_measured():
    question = TaskQuestion("Does a help?", ("a", "c"), runs=10)
    for found in (pd.DataFrame(), pd.DataFrame([row()])):
        assert answer_over_tasks(question, found, runs=0) == "measured so far: 0 of 10 runs"
        assert answer_over_tasks(question, found, runs=9) == "measured so far: 9 of 10 runs"  # of other tasks
        assert (
            answer_over_tasks(question, found, runs=10) == "not decided: a task has no seed of both, a and c"
        )
