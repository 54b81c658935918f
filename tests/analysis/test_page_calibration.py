"""How far signals are probabilities, on two seeds made by hand."""

import pandas as pd
import pytest
from published_runs import COMMIT, THEIRS

from tstar_rl.analysis import read_calibration, read_metrics, turn_table
from tstar_rl.analysis.calibration import BINS, calibration_of_arms, pooled
from tstar_rl.analysis.page import results_page
from tstar_rl.analysis.page.drawing import draw_page
from tstar_rl.chaining.calibration import BINS as WRITTEN


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
    line = calibration_of_arms(read_metrics(judged / "odd"), "table").loc["tstar", "d_omega"]
    assert line[["seeds", "auc", "ece", "rate"]].tolist() == [2, 0.75, 0.25, 0.25]
    assert line["brier"] == pytest.approx(0.2)
    low, high = pooled(read_calibration(judged / "odd")).to_dict("records")
    assert (low["score"], low["outcome"], low["states"]) == (pytest.approx(0.05), 0.0, 4)
    assert high["outcome"] == pytest.approx((3 * 1.0 + 4 * 0.5) / 7) and high["states"] == 7


def test_the_page_has_its_table_and_its_figure(judged):
    page = results_page(judged, THEIRS, "")
    assert "#### Calibration" in page
    assert "| T-STAR | 2 | 2 | 0.75 | 0.20 | 0.25 | 0.25 |" in page
    drawn = draw_page(judged, THEIRS, judged / "figures")
    assert judged / "figures" / "odd_table_calibration.png" in drawn and "odd_table_calibration.png" in page


def test_a_turn_after_which_all_outcomes_were_alike_is_not_behind_the_auc(judged):
    file = judged / "odd/table/tstar/seed3/metrics.csv"
    turns = pd.read_csv(file)
    more = turns.iloc[:1].assign(env_steps=3, d_omega_auc=None, d_omega_brier=0.5)
    pd.concat([turns, more]).to_csv(file, index=False)
    line = calibration_of_arms(read_metrics(judged / "odd"), "table").loc["tstar", "d_omega"]
    assert line[["told", "auc"]].tolist() == [2, 0.75] and line["brier"] == pytest.approx((0.3 + 0.3) / 2)


def test_two_signals_of_an_arm_stand_apart(judged):
    for seed in (3, 4):
        place = judged / f"odd/table/tstar/seed{seed}"
        turns, bins = (pd.read_csv(place / f"{name}.csv") for name in ("metrics", "calibration"))
        mine = turns.filter(like="d_omega_").rename(columns=lambda name: name.replace("d_omega", "mine"))
        pd.concat([turns, mine - 0.05], axis=1).to_csv(place / "metrics.csv", index=False)
        both = pd.concat([bins, bins.assign(signal="mine", outcome=0.5)])
        both.to_csv(place / "calibration.csv", index=False)
    page = results_page(judged, THEIRS, "")
    assert "| T-STAR: d omega | 2 | 2 | 0.75 | 0.20 | 0.25 | 0.25 |" in page
    assert "| T-STAR: mine | 2 | 2 | 0.70 | 0.15 | 0.25 | 0.20 |" in page
    found = pooled(read_calibration(judged / "odd")).groupby("signal")["outcome"].agg(list)
    assert found["mine"] == [0.5, 0.5] and found["d_omega"][0] == 0.0
    draw_page(judged, THEIRS, judged / "figures")
    assert turn_table(read_metrics(judged / "odd"), "table").loc["tstar", ["auc", "spread"]].isna().all()


def test_the_rate_of_success_is_no_yardstick_for_a_share_of_the_rest(judged):
    for seed in (3, 4):
        (judged / f"odd/table/tstar/seed{seed}/config.yaml").write_text(
            f"label: share\nversions: {{commit: {COMMIT}}}\n"
        )
    assert "| T-STAR | 2 | 2 | 0.75 | 0.20 | - | 0.25 |" in results_page(judged, THEIRS, "")


def test_bins_are_those_that_a_recipe_writes():
    assert BINS == WRITTEN


def test_a_chain_that_recovers_is_judged_without_turns(judged):
    """Such a table has neither trials nor a gate."""
    for seed in (3, 4):
        said = {"feasibility_auc": 0.8, "feasibility_brier": 0.1, "feasibility_ece": 0.05}
        row = {"env_steps": 9, "skill": 1, "handed": 8, "next_success": 0.25, **said}
        pd.DataFrame([row]).to_csv(judged / f"odd/table/tstar/seed{seed}/metrics.csv", index=False)
    assert "| T-STAR | 2 | 2 | 0.80 | 0.10 | 0.19 | 0.05 |" in results_page(judged, THEIRS, "")


def test_an_experiment_without_signals_has_no_such_part(published):
    assert "#### Calibration" not in results_page(published, THEIRS, "")
    assert not [path for path in draw_page(published, THEIRS, published / "figures") if "calib" in path.name]
