"""Whether chains get worse with time, on trials made by hand."""

import pandas as pd
import pytest
from published_runs import THEIRS, contents

from tstar_rl.analysis.late_trials import late_trials
from tstar_rl.analysis.page import results_page
from tstar_rl.checks import InvalidValueError

HALF = 12.706 * 0.1 / 2**0.5
"""Of two numbers that are .1 * sqrt(2) apart: Student's quantile times their deviation over the root of two."""


def trials(arm: str, *seeds: list[float]) -> pd.DataFrame:
    """Rows of metrics: rounds of two turns with a trial after each, and a row without one. The first turn's is of no
    account."""
    rows = []
    for seed, progress in enumerate(seeds):
        for index, value in enumerate(progress):
            for step, found in ((1, 1.0), (5, value), (7, None)):
                row = {"seed": seed, "round": index, "env_steps": 10 * index + step}
                rows.append({**row, "trial_progress": found})
    return pd.DataFrame(rows).assign(task="table", subtask=-1, recipe=arm)


def test_the_last_trial_less_the_best_before_it_and_less_one_of_them():
    metrics = pd.concat(
        [
            trials("tstar", [0.5, 0.9, 0.6, 0.8], [0.4, 0.6, 0.7, 0.7 + 0.1 * (2**0.5 - 1)]),
            trials("buffer", [0.5, 0.75, 0.25]),
            trials("gaussian", [0.5, 0.6]),
        ]
    )
    found = late_trials(metrics.iloc[::-1], "table", earlier=2)
    assert found.index.tolist() == ["buffer", "tstar"]  # a chain of two rounds is left out
    tstar = found.loc["tstar"]
    assert tstar[["seeds", "rounds"]].tolist() == [2, 4]
    best = [-0.1, 0.1 * (2**0.5 - 1)]
    assert tstar["since_best"] == pytest.approx(sum(best) / 2)
    assert tstar["since_best_half"] == pytest.approx(HALF, abs=1e-4)
    assert tstar["since"] == pytest.approx((-0.1 + 0.1 * 2**0.5) / 2)
    assert found.loc["buffer", ["last", "since_best", "since"]].tolist() == [0.25, -0.5, -0.5]
    assert found.loc["buffer", ["since_best_half", "since_half"]].isna().all()


def test_of_a_seed_with_more_rounds_as_many_count_as_the_others_have():
    found = late_trials(trials("tstar", [0.5, 0.6, 0.7], [0.5, 0.8]), "table", earlier=1)
    assert found.loc["tstar", "last"] == pytest.approx(0.7) and found.loc["tstar", "rounds"] == 2


def test_a_round_is_known_by_its_number_also_where_others_have_no_trial():
    metrics = trials("tstar", [0.5, 0.6, 0.7, 0.9], [0.5, 0.8, 0.8, 0.8])
    third = metrics["round"] == 2
    found = late_trials(metrics[metrics["round"] != 1], "table", earlier=1).loc["tstar"]
    assert found[["rounds", "last", "since"]].tolist() == [4, pytest.approx(0.85), pytest.approx(0.35)]
    assert found["since_best"] == pytest.approx((0.9 - 0.7) / 2)
    assert late_trials(metrics[metrics["round"] != 1], "table", earlier=2).empty
    alone = metrics[~third | (metrics["seed"] == 0)]  # a round that one seed alone has a trial of
    assert late_trials(alone, "table", earlier=3).empty
    assert late_trials(alone, "table", earlier=2).loc["tstar", "since_best"] == pytest.approx(0.15)


@pytest.mark.parametrize("earlier", [0, -1, "best", 1.5])
def test_what_is_no_number_of_a_round_is_refused(earlier):
    with pytest.raises(InvalidValueError, match="counted from 1, got"):
        late_trials(trials("tstar", [0.5, 0.6]), "table", earlier)


def test_the_page_has_the_table_of_an_experiment_that_declared_it(published):
    assert "#### Later trials" not in results_page(published, THEIRS, "")
    for seed, progress in ((3, [0.5, 0.75]), (4, [0.5, 0.75])):
        rows = pd.DataFrame({"trial_progress": progress, "env_steps": [1, 2], "round": [0, 1], "skill": 0})
        rows.to_csv(published / f"odd/table/tstar/seed{seed}/metrics.csv", index=False)
    odd = {"folder": "odd", "kind": "experiment", "pairs": [["tstar", "buffer_no_gate"]]}
    contents(published, [{**odd, "late_trials": 1}, {"folder": "plain", "kind": "paper"}])
    page = results_page(published, THEIRS, "")
    assert "| arm | seeds | rounds | last trial | less the best before it | less that of round 1 |" in page
    assert "| T-STAR | 2 | 2 | 0.750 | +0.250 | +0.250 |" in page
    contents(published, [{**odd, "late_trials": 2}, {"folder": "plain", "kind": "paper"}])
    assert "#### Later trials" not in results_page(published, THEIRS, "")
