"""Answers over tasks: the comparison of two arms by hand, and the rule declared with a question."""

import numpy as np
import pandas as pd
import pytest

from tstar_rl.analysis.task_questions import TaskQuestion, answer_over_tasks, compare_over_tasks


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
    assert (row.first, row.second, row.runs, row.tasks, row.ahead) == ("a", "b", 5, 3, 1)
    assert row.improvement == pytest.approx((1 + 0.5 + 0) / 3) == row.improvement_low == row.improvement_high
    assert row.p_value == pytest.approx(1.0)  # one of three: 1 or fewer, or 2 or more
    both = compare_over_tasks(
        {"won": scores["won"]} | {str(n): scores["won"] for n in range(5)}, list("01234"), [("a", "b")]
    )
    assert both["p_value"].item() == pytest.approx(2 / 32) and both["runs"].item() == 12
    assert compare_over_tasks(scores, [], [("a", "b")]).empty


def row(value=0.8, low=0.6, high=0.9, ahead=8, tasks=9, p_value=0.039, runs=10) -> dict:
    ends = {"improvement": value, "improvement_low": low, "improvement_high": high}
    return {
        "first": "a",
        "second": "b",
        "runs": runs,
        "tasks": tasks,
        "ahead": ahead,
        "p_value": p_value,
        **ends,
    }


@pytest.mark.parametrize(
    ("found", "expected"),
    [
        (row(), "yes"),
        (row(ahead=7, p_value=0.18), "not decided: ahead on 7 of 9 tasks alone"),
        (row(ahead=1), "not decided: ahead on 1 of 9 tasks alone"),  # few, though the sign test is sure
        (row(0.55, 0.45, 0.7), "no, or not by much"),
        (row(0.2, 0.1, 0.3), "no: it does worse"),
        # .1 from .5 with a lower half of .2: 4 x 2.043 times the seeds, with 2.043 = ((1.960 + .842) / 1.960) ** 2; .15
        # from the margin with an upper half of .2: 1.778 x 2.043.
        (row(0.6, 0.4, 0.8), "not decided; 3.7 times as many seeds probably would"),
        (
            row(0.7, 0.45, 0.8),
            "not decided; 3.2 times as many seeds probably would",
        ),  # (.25 / .2) ** 2 x 2.043
        (row(runs=9), "being measured: 9 of 10 runs"),
    ],
)
def test_an_answer_follows_the_interval_and_the_signs(found, expected):
    question = TaskQuestion("Does a help?", ("a", "b"), runs=10)
    assert answer_over_tasks(question, pd.DataFrame([found])) == expected


def test_a_pair_that_was_not_run_is_being_measured():
    question = TaskQuestion("Does a help?", ("a", "c"), runs=10)
    for found in (pd.DataFrame(), pd.DataFrame([row()])):
        assert answer_over_tasks(question, found) == "being measured: 0 of 10 runs"
