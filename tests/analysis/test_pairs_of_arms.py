"""Hand-overs of two arms seam by seam, and every way of reading their difference, on numbers worked by hand."""

import pandas as pd
import pytest
from arm_tables import write_arm

from tstar_rl.analysis.experiments import read_experiment
from tstar_rl.analysis.hand_overs import compare_hand_overs, signal_by_seam, success_at_hand_over
from tstar_rl.analysis.page.contents import Entry
from tstar_rl.analysis.page.pairs import readings, seams
from tstar_rl.checks import InvalidValueError

T = 12.7062
"""Student's quantile with one degree of freedom."""


def test_a_skill_is_judged_by_the_episodes_that_come_to_it():
    rows = pd.DataFrame(
        {"seed": [0, 1], "subtask_0": [0.8, 0.0], "subtask_1": [0.6, 0.0], "subtask_10": [0.3, 0.0]}
    ).assign(subtask_2=None)
    found = success_at_hand_over(rows)
    assert found.loc[0].tolist() == pytest.approx([0.8, 0.75, 0.5])  # the tenth comes last, not second
    assert found.loc[1, 0] == 0.0 and found.loc[1, [1, 2]].isna().all()


def test_two_arms_at_a_seam(two_arms):
    found = compare_hand_overs(read_experiment(two_arms).chosen("table"), "tstar", "buffer")
    assert found.index.tolist() == [1]
    seam = found.loc[1]  # .9 and .7; .6 of .9 and .4 of .8
    assert seam[["seeds", "first"]].tolist() == pytest.approx([2, 0.8])
    assert seam["second"] == pytest.approx((2 / 3 + 0.5) / 2)
    assert seam["difference"] == pytest.approx(0.8 - (2 / 3 + 0.5) / 2)
    assert seam["t_half"] == pytest.approx(T * (0.9 - 2 / 3 - 0.2) / 2, rel=1e-4)


def turns() -> pd.DataFrame:
    """Two seeds. Of the first skill's turns one was put back, and one had one outcome; the second had one turn."""
    rows = [
        {"seed": 0, "skill": 0, "d_omega_auc": 0.6, "d_omega_sd": 0.1, "accepted": 1},
        {"seed": 0, "skill": 0, "d_omega_auc": 0.1, "d_omega_sd": 0.9, "accepted": 0},
        {"seed": 0, "skill": 0, "d_omega_auc": None, "d_omega_sd": 0.3, "accepted": 1},
        {"seed": 1, "skill": 0, "d_omega_auc": 0.7, "d_omega_sd": 0.2, "accepted": 1},
        {"seed": 1, "skill": 0, "d_omega_auc": 0.9, "d_omega_sd": 0.4, "accepted": 1},
        {"seed": 1, "skill": 1, "d_omega_auc": 0.5, "d_omega_sd": 0.0, "accepted": 1},
        {"seed": 1, "skill": 2, "d_omega_auc": None, "d_omega_sd": None, "accepted": 1},
    ]
    return pd.DataFrame(rows).assign(task="table", recipe="tstar", subtask=-1, trial_progress=0.5)


def test_what_a_signal_told_at_each_seam():
    found = signal_by_seam(turns(), "table", "tstar")
    assert found.index.tolist() == [1, 2]  # by the skill that takes over
    assert found.loc[1, ["seeds", "auc", "spread"]].tolist() == pytest.approx([2, 0.7, 0.25])
    assert found.loc[1, "auc_half"] == pytest.approx(T * 0.1, rel=1e-4)
    assert found.loc[2, ["seeds", "auc"]].tolist() == [1, 0.5] and pd.isna(found.loc[2, "auc_half"])
    assert signal_by_seam(turns(), "table", "buffer").empty
    assert signal_by_seam(turns().drop(columns="trial_progress"), "table", "tstar").empty


def test_a_pair_on_the_page(two_arms):
    experiment, entry = read_experiment(two_arms), Entry(two_arms, "experiment")
    paper = {"systems": {}, "arms": {"tstar": "T-STAR"}}
    asked = (experiment, paper, entry, "table", ["tstar", "buffer"])
    table = seams(*asked).splitlines()
    assert (
        table[0].startswith("| seam | seeds | the next succeeds: T-STAR | buffer | difference [95%")
        and len(table) == 3
    )
    assert table[2].startswith("| skill 1 to skill 2 | 2 | 0.800 | 0.583 | +0.217 [")
    assert "AUC" not in table[0]  # nothing was logged
    run = two_arms / "table" / "tstar"
    for seed, mine in turns().drop(columns=["task", "recipe", "subtask"]).groupby("seed"):
        mine.to_csv(run / f"seed{seed}" / "metrics.csv", index=False)
    assert seams(*asked).splitlines()[2].endswith("| 0.70 +- 1.27 | 0.25 |")
    rows = readings(*asked).splitlines()[2:]
    assert rows[0].startswith(
        "| last checkpoint, deterministic actions | 2 | +0.225 ["
    )  # .95 and .85; .75 and .6
    whole = rows[0].split(" | ")[3]
    assert whole.startswith("+0.300 [")  # .9 and .7; .6 and .4


def test_an_area_of_other_seeds_than_the_difference_says_so(two_arms):
    """Seed 0 has no AUC, seed 2 has one and no buffer arm."""
    asked = ({"systems": {}}, Entry(two_arms, "experiment"), "table", ["tstar", "buffer"])
    run = two_arms / "table" / "tstar"
    write_arm(two_arms, "tstar", 2, [1.0, 0.7])
    for seed, area in ((0, None), (1, 0.7), (2, 0.9)):
        row = {"skill": 0, "d_omega_auc": area, "d_omega_sd": 0.2, "subtask": -1, "trial_progress": 0.5}
        pd.DataFrame([row]).to_csv(run / f"seed{seed}" / "metrics.csv", index=False)
    line = seams(read_experiment(two_arms), *asked).splitlines()[2]
    assert line.endswith("| 0.80 +- 1.27 (2 seeds, others too) | 0.20 |")


@pytest.mark.parametrize("table", [seams, readings])
def test_an_arm_that_is_not_there_is_named(table, two_arms):
    asked = (
        read_experiment(two_arms),
        {"systems": {}},
        Entry(two_arms, "experiment"),
        "table",
        ["tstar", "bufer"],
    )
    with pytest.raises(InvalidValueError, match="table has no arm bufer; it has buffer, tstar"):
        table(*asked)


def test_of_an_arm_with_two_signals_neither_is_called_what_pays():
    assert signal_by_seam(turns().assign(mine_auc=0.9, mine_sd=0.1), "table", "tstar").empty


@pytest.mark.parametrize("named", [["tstar"], ["tstar", "buffer", "gaussian"], []])
@pytest.mark.parametrize("table", [seams, readings])
def test_a_pair_is_two_arms(table, named, two_arms):
    with pytest.raises(InvalidValueError, match=f"a pair of arms is two, got {', '.join(named) or 'none'}"):
        table(read_experiment(two_arms), {"systems": {}}, Entry(two_arms, "experiment"), "table", named)
