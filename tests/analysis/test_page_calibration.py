"""How far signals are probabilities, on two seeds made by hand."""

import pandas as pd
import pytest
from published_runs import THEIRS

from tstar_rl.analysis import read_calibration, read_metrics
from tstar_rl.analysis.calibration import calibration_of_arms, pooled
from tstar_rl.analysis.page import results_page
from tstar_rl.analysis.page.drawing import draw_page


@pytest.fixture
def judged(published):
    """T-STAR's d_omega: the second turn of each seed is put back; the other arm has no signal."""
    for seed, brier in ((3, 0.1), (4, 0.3)):
        place = published / f"odd/table/tstar/seed{seed}"
        turns = {"env_steps": [1, 2], "skill": 0, "accepted": [1, 0], "trial_progress": 0.5}
        said = {"d_omega_auc": [0.75, 0.0], "d_omega_brier": [brier, 1.0], "d_omega_ece": [0.25, 1.0]}
        pd.DataFrame({**turns, **said, "next_success": 0.5}).to_csv(place / "metrics.csv", index=False)
        bins = {"score": [0.05, 0.95], "outcome": [0.0, 1.0 - (seed - 3) / 2], "states": [2, seed]}
        rows = pd.DataFrame({"env_steps": 1, "skill": 0, "signal": "d_omega", **bins})
        rows.to_csv(place / "calibration.csv", index=False)
    return published


def test_what_was_said_against_what_happened_by_hand(judged):
    line = calibration_of_arms(read_metrics(judged / "odd"), "table").loc["tstar"]
    assert line[["seeds", "signal", "auc", "ece", "rate"]].tolist() == [2, "d_omega", 0.75, 0.25, 0.25]
    assert line["brier"] == pytest.approx(0.2)
    low, high = pooled(read_calibration(judged / "odd")).to_dict("records")
    assert (low["score"], low["outcome"], low["states"]) == (pytest.approx(0.05), 0.0, 4)
    assert high["outcome"] == pytest.approx((3 * 1.0 + 4 * 0.5) / 7) and high["states"] == 7


def test_the_page_has_its_table_and_its_figure(judged):
    page = results_page(judged, THEIRS, "")
    assert "#### Calibration" in page
    assert "| T-STAR | 2 | 0.75 | 0.20 | 0.25 | 0.25 |" in page
    drawn = draw_page(judged, THEIRS, judged / "figures")
    assert judged / "figures" / "odd_table_calibration.png" in drawn and "odd_table_calibration.png" in page


def test_an_experiment_without_signals_has_no_such_part(published):
    assert "#### Calibration" not in results_page(published, THEIRS, "")
    assert not [path for path in draw_page(published, THEIRS, published / "figures") if "calib" in path.name]
