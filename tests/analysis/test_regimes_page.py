"""What docs/experiments/regimes.md says of all regimes is what the published tables say."""

from pathlib import Path

import pytest

from tstar_rl.analysis.experiments import read_experiment
from tstar_rl.analysis.gaps_of_runs import hand_over_gaps

ROOT = Path(__file__).resolve().parents[2]
SECTION = (ROOT / "docs" / "experiments" / "regimes.md").read_text().split("## All regimes side by side")[1]
ROWS = [line.strip("| ").split(" | ") for line in SECTION.split("\n## ")[0].splitlines() if "(`" in line]


@pytest.mark.parametrize(("regime", "task"), [(row[0], row[1]) for row in ROWS])
def test_levels_and_gaps_of_a_regime(regime, task):
    (row,) = (row for row in ROWS if row[:2] == [regime, task])
    experiment = read_experiment(ROOT / "results" / "published" / regime.split("`")[1])
    gaps, arms = hand_over_gaps(experiment, task), experiment.chosen(task)
    level = arms[arms["arm"] == "no_finetuning"]["progress"]
    gap = {arm: mine["gap"].mean() for arm, mine in gaps.groupby("arm")}
    assert row[2:3] + row[4:6] == [
        str(len(level)),
        f"{level.mean():.3f}".removeprefix("0"),
        f"{gap['no_finetuning']:.3f}".replace("0.", ".", 1),
    ]
    floored = f"{gap['floored']:.3f}".replace("0.", ".", 1) if "floored" in gap else "not run"
    assert row[6].rpartition(": ")[2] == floored


def test_the_page_has_its_fifteen_regimes():
    assert len(ROWS) == 15
