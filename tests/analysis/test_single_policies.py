"""Single policies of the whole task on the page: each seed with its interval, the paper's figures, and curves."""

import math

import pandas as pd
import pytest
from published_runs import THEIRS, contents, write

from tstar_rl.analysis import read_metrics
from tstar_rl.analysis.figures import running_means
from tstar_rl.analysis.page import draw_page, results_page
from tstar_rl.analysis.page.contents import read_contents

ENTRY = {"folder": "alone", "kind": "single_policies"}


@pytest.fixture
def alone(tmp_path):
    """Three seeds of BC and one of another policy, and a curve of two rollouts."""
    for seed, progress in ((7, 0.0), (8, 0.25), (9, 0.5)):
        write(tmp_path, "alone", "bc", seed, progress)
        file = tmp_path / "alone" / "table" / "bc" / f"seed{seed}" / "evaluation.csv"
        last = pd.read_csv(file).query("checkpoint == 'last'")
        others = [
            last.assign(checkpoint="best", progress=0.75),
            last.assign(mode="stochastic", progress=0.625),
        ]
        pd.concat([last, *others]).to_csv(file, index=False)
    write(tmp_path, "alone", "ppo", 7, 1.0)
    rows = [{"env_steps": 10, "episodes": 0, "phase": 1.0}, {"env_steps": 20, "episodes": 2, "phase": 3.0}]
    rows[1]["completed"] = 1.0
    pd.DataFrame(rows).to_csv(tmp_path / "alone/table/ppo/seed7/metrics.csv", index=False)
    (tmp_path / "alone" / "README.md").write_text("# Alone\n\nOf the whole task.\n")
    contents(tmp_path, [ENTRY])
    return tmp_path


def test_each_seed_has_its_interval_and_the_mean_has_students(alone):
    page = results_page(alone, THEIRS, "")
    assert "All runs come from commit ccccccc." in page
    # Wilson's of 0, 50 and 100 of 200; Student's t of three seeds that deviate by .25: 4.303 * .25 / sqrt 3.
    seeds = "7: 0.000 [0.000, 0.019]; 8: 0.250 [0.20, 0.31]; 9: 0.500 [0.43, 0.57]"
    assert f"| BC | 0.03 +- 0.00 | {seeds} | 0.250 +- 0.621 |" in page
    assert "| ppo | - | 7: 1.000 [0.981, 1.000] | 1.000 |" in page
    assert f"| BC | {seeds} | 0.625 | 0.750 | 0.50M |" in page


def test_nothing_is_compared_over_tasks(alone):
    (alone / "alone" / "table").rename(alone / "alone" / "chair")
    for seed in (7, 8):
        write(alone, "alone", "bc", seed, 0.5)
    page = results_page(alone, THEIRS, "")
    assert "over all tasks" not in page and "### Alone: chair" in page and "### Alone: table" in page


def test_its_curves_are_drawn(alone, tmp_path_factory):
    assert [path.name for path in draw_page(alone, THEIRS, tmp_path_factory.mktemp("figures"))] == [
        "alone_table_single_policies.png"
    ]
    assert "figures/alone_table_single_policies.png" in results_page(alone, THEIRS, "")
    assert read_contents(alone).experiments[0].kind == "single_policies"


def test_a_rollout_counts_by_its_episodes(alone):
    rows = pd.DataFrame(
        {
            "env_steps": [1, 2, 3, 4],
            "episodes": [0, 1, 3, 1],
            "completed": [math.nan, 1.0, 2.0, 0.0],
            "phase": [1.0, 2.0, 6.0, 4.0],
            "task": "table_lack",
            "recipe": "ppo",
            "seed": 7,
            "subtask": -1,
        }
    )
    found = running_means(rows, ["completed", "phase", "unknown"], window=2)
    # (1 + 3 * 2) / 4 and (3 * 2 + 0) / 4; phases are means over steps, of which each rollout has as many.
    assert found["completed"].tolist() == pytest.approx([math.nan, 1.0, 1.75, 1.5], nan_ok=True)
    assert found["phase"].tolist() == [1.0, 1.5, 4.0, 5.0]
    two = pd.concat([rows, rows.assign(seed=8, phase=9.0)])
    assert running_means(two, ["phase"], 2)["phase"].tolist()[4:] == [9.0] * 4
    of_another_task = pd.concat([rows, rows.assign(task="chair_ingolf", phase=9.0)])
    assert running_means(of_another_task, ["phase"], 2)["phase"].tolist()[4:] == [9.0] * 4
    assert read_metrics(alone / "alone")["completed"].notna().sum() == 1
