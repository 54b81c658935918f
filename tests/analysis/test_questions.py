"""Answers of an experiment, by the rules that were declared, on tables written by hand."""

import math

import pandas as pd
import pytest

from tstar_rl.analysis.questions import Question, answer, seeds_to_decide


def compared(first="a", second="b", difference=0.1, half=0.05, seeds=10, **more) -> dict:
    verdict = "higher" if difference > half else "lower" if difference < -half else "no clear difference"
    row = {"first": first, "second": second, "difference": difference, "t_half": half, "seeds": seeds}
    ends = {"low": difference - half, "high": difference + half, "verdict": verdict}
    return {**row, **ends, "improvement": 1.0, "corrected": 0.001, **more}


def said(*rows: dict, pairs=(("a", "b"),), seeds=10, **rule) -> str:
    return answer(Question("Does it?", pairs, seeds, **rule), pd.DataFrame(rows))


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        (compared(), "yes"),
        (compared(seeds=9), "measured so far: 9 of 10 seeds"),
        (compared("a", "c"), "measured so far: 0 of 10 seeds"),
        (compared(difference=0.03, half=0.01), "yes, by less than 0.05"),
        (compared(difference=0.01, half=0.02), "no: a gain of 0.05 is ruled out"),
        (compared(difference=-0.01, half=0.02), "no: a gain of 0.05 is ruled out"),
        (compared(difference=-0.1, half=0.02), "no: it is lower"),
        # The bootstrap's end is below the margin, Student's is not. The deviation is .04 sqrt(10) / 2.262 = .0559, and
        # the margin .03 away. With t(.975) + t(.80): (2.048 + .855) x .0559 / sqrt(29) = .0301, of 30 seeds
        # (2.045 + .854) x .0559 / sqrt(30) = .0296.
        (compared(difference=0.02, half=0.04, high=0.03), "not decided; 30 seeds probably would"),
        # The other way round: the bootstrap's upper end is what is .04 away.
        (compared(difference=0.02, half=0.02, high=0.06), "not decided; 30 seeds probably would"),
        # Student's interval leaves out 0 already, the bootstrap's is .11 wide there. The deviation is then
        # .11 sqrt(10) / 2.262 = .1538, and 0 is .1 away: (2.086 + .860) x .1538 / sqrt(21) = .0989, of 20 seeds .1015.
        (
            compared(half=0.01, low=-0.01, high=0.2, verdict="no clear difference"),
            "not decided; 21 seeds probably would",
        ),
        # One seed has no Student's interval, so nothing is ruled out.
        (
            compared(difference=0.01, half=math.nan, low=0.0, high=0.02, verdict="one seed"),
            "not decided",
        ),
    ],
)
def test_an_answer_follows_the_intervals_and_the_margin(row, expected):
    assert said(row, margin=0.05) == expected


def test_few_seeds_say_nothing_of_how_many_would_do():
    assert said(compared(difference=0.02, half=0.04, seeds=5), seeds=5, margin=0.05) == "not decided"


def test_without_a_margin_there_is_no_no_but_for_what_is_lower():
    assert said(compared(difference=-0.01, half=0.02)) == "not shown"
    assert said(compared(difference=-0.1, half=0.02)) == "no: it is lower"


def test_every_pair_must_be_higher():
    pairs = (("a", "b"), ("a", "c"))
    assert said(compared(), compared(second="c"), pairs=pairs) == "yes"
    assert said(compared(), compared(second="c", half=0.2), pairs=pairs) == "not shown"
    assert said(compared(), compared(second="c", seeds=9), pairs=pairs) == "measured so far: 9 of 10 seeds"
    assert said(compared(), compared(second="c", difference=-0.1), pairs=pairs) == "not shown"
    better = {"pairs": pairs, "improvement": 0.95}
    assert said(compared(), compared(second="c"), **better) == "yes"
    assert said(compared(), compared(second="c", improvement=0.9), **better) == "not shown"


def test_no_number_of_seeds_is_promised_where_pairs_are_settled_in_different_ways():
    rows = (compared(difference=0.3), compared(second="c", difference=-0.2))
    assert said(*rows, pairs=(("a", "b"), ("a", "c")), margin=0.05) == "not decided"
    open_ones = (compared(difference=0.02, half=0.04), compared(second="c", difference=0.02, half=0.04))
    assert said(*open_ones, pairs=(("a", "b"), ("a", "c")), margin=0.05).endswith("30 seeds probably would")


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        (compared(improvement=0.95), "yes"),
        (compared(improvement=0.94), "not shown"),
        (compared(corrected=0.05), "not shown"),
        (compared(difference=-0.1, improvement=0.95), "not shown"),
    ],
)
def test_an_improvement_needs_its_probability_and_its_corrected_p_value(row, expected):
    assert said(row, improvement=0.95) == expected


def test_seeds_to_decide_by_the_table_of_students_t():
    # t(.975) + t(.80) of 4 seeds is 3.182 + .978, of 5 is 2.776 + .941: 4.160 / 2 = 2.080, 3.717 / sqrt(5) = 1.662.
    assert seeds_to_decide(1.7, 1.0, 0.0) == 5
    assert seeds_to_decide(2.1, 1.0, 0.0) == 4
    assert seeds_to_decide(-1.5, 1.0, 0.2) == 5  # the margin is 1.7 away
    assert seeds_to_decide(0.0, 1.0, 1e-6) is None
    assert seeds_to_decide(0.0, 0.0, 0.05) == 2
