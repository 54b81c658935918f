"""How good a score of states is, on numbers worked by hand."""

import math

import pytest
import torch
from torch.testing import assert_close

from tstar_rl.chaining.calibration import (
    area_under_curve,
    brier_score,
    expected_calibration_error,
    reliability_curve,
)
from tstar_rl.chaining.signals import judge

SCORES = torch.tensor([0.1, 0.3, 0.8, 1.0])
OUTCOMES = torch.tensor([False, True, True, True])


def test_area_under_curve_by_hand():
    # Successes .9 and .4, failures .5 and .4: of four pairs two are right, one is a tie, one is wrong.
    scores, outcomes = torch.tensor([0.9, 0.4, 0.5, 0.4]), torch.tensor([True, True, False, False])
    assert area_under_curve(scores, outcomes) == (2 + 0.5) / 4
    assert math.isnan(area_under_curve(scores, torch.ones(4, dtype=torch.bool)))


def test_brier_score():
    # distances .1, .7, .2, 0: squares .01 + .49 + .04 + 0 over four
    assert brier_score(SCORES, OUTCOMES) == pytest.approx(0.135)
    assert brier_score(torch.full((4,), 0.75), OUTCOMES) == pytest.approx(0.75 * 0.25)  # p (1 - p)
    assert brier_score(torch.tensor([0.5]), torch.tensor([0.5])) == 0  # a share that is right


def test_reliability_curve():
    # Two bins: .1 and .3 below a half, of which one succeeded; .8 and 1 above, of which both did.
    curve = reliability_curve(SCORES, OUTCOMES, bins=2)
    assert_close(curve.score, torch.tensor([0.2, 0.9]).double())
    assert_close(curve.outcome, torch.tensor([0.5, 1.0]).double())
    assert curve.count.tolist() == [2, 2]
    assert expected_calibration_error(curve) == pytest.approx((2 * 0.3 + 2 * 0.1) / 4)
    empty_left_out = reliability_curve(SCORES, OUTCOMES, bins=10)
    assert empty_left_out.count.tolist() == [1, 1, 1, 1]  # .1, .3, .8, and 1 in the last


def test_a_calibrated_score_has_no_error():
    calibrated = torch.tensor([0.25] * 4)
    assert expected_calibration_error(reliability_curve(calibrated, torch.tensor([1, 0, 0, 0]).bool())) == 0


class Says:
    def __init__(self, slot: int = 0) -> None:
        self.slot = slot

    def said(self, obs):
        return obs[:, self.slot : self.slot + 1]


def test_a_signal_is_judged_by_what_the_next_skill_did():
    handed = torch.stack([SCORES, -SCORES], -1)
    columns, curve = judge("f", Says(), handed, OUTCOMES, OUTCOMES)
    assert columns["f_auc"] == 1 and columns["f_brier"] == pytest.approx(0.135)
    assert columns["f_sd"] == pytest.approx(float(SCORES.std())) and int(curve.count.sum()) == 4
    shares, _ = judge("f", Says(), handed, OUTCOMES, torch.tensor([0.0, 0.5, 0.5, 1.0]))
    assert shares["f_auc"] == 1 and shares["f_brier"] == pytest.approx((0.01 + 0.04 + 0.09) / 4)
    wrong, _ = judge("f", Says(1), handed, OUTCOMES, OUTCOMES)
    assert wrong["f_auc"] == 0.5 and wrong["f_sd"] == 0  # clipped to zero, as it would be paid
    nothing, curve = judge("f", Says(), handed[:0], OUTCOMES[:0], OUTCOMES[:0])
    assert curve is None and all(math.isnan(value) for value in nothing.values())


def test_what_is_no_share_is_told():
    for wrong, told in ((1.2, "1 of 2 others, as 1.2"), (math.nan, "1 of 2 others, as nan")):
        with pytest.raises(ValueError, match=f"needs scores in \\[0, 1\\], got {told}"):
            reliability_curve(torch.tensor([0.5, wrong]), torch.ones(2))
    with pytest.raises(ValueError, match="at least 1 bin, got 0"):
        reliability_curve(torch.ones(2), torch.ones(2), bins=0)
