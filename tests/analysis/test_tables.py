"""Reading metrics and evaluations of several runs, and the steps that they tell of."""

import pandas as pd
import pytest

from tstar_rl.analysis import evaluation_table, learning_curves, read_evaluations, read_metrics, steps_of_arms
from tstar_rl.runs.csv_tables import MetricsLog, append_rows


def test_rows_of_another_seed_are_refused(tmp_path):
    row = {"checkpoint": "last", "mode": "deterministic"}
    file = tmp_path / "table" / "tstar" / "seed1" / "evaluation.csv"
    append_rows(file, [{**row, "seed": seed} for seed in (0, 1)], ("checkpoint", "mode", "seed"))
    with pytest.raises(ValueError, match="seed1/evaluation.csv has rows of seed 0: they are another run's"):
        read_evaluations(tmp_path)
    append_rows(tmp_path / "a" / "b" / "c" / "seed2" / "evaluation.csv", [row], ("mode",))
    pd.DataFrame([{**row, "seed": 1}]).to_csv(file, index=False)
    assert read_evaluations(tmp_path)[["recipe", "seed", "subtask"]].values.tolist() == [["tstar", 1, -1]]


def test_curves_and_table_from_folders(tmp_path):
    for recipe, success in (("tstar", 0.9), ("policy_sequencing", 0.6)):
        folder = tmp_path / "table_lack" / recipe / "seed0"
        log = MetricsLog(folder / "metrics.csv")
        for steps in (10, 20):
            log.append({"env_steps": steps, "success_rate": success, "kl": 0.01})
        row = {"checkpoint": "last", "mode": "deterministic", "progress": success, "success": success}
        row |= {
            "success_low": 0.5,
            "success_high": 1.0,
            "subtask_0": 1.0,
            "env_steps": 20,
            "minutes": 1,
            "seed": 0,
        }
        append_rows(folder / "evaluation.csv", [row], ("checkpoint", "mode"))
    panels = learning_curves(read_metrics(tmp_path)).axes
    assert [axes.get_title() for axes in panels] == ["success rate", "kl"]
    drawn = {line.get_label(): line.get_xydata().tolist() for line in panels[0].lines}
    assert drawn["tstar seed 0"] == [[10, 0.9], [20, 0.9]] and len(drawn) == 2
    with pytest.raises(ValueError, match="none of loss was logged; there are "):
        learning_curves(read_metrics(tmp_path), ["loss"])
    table = evaluation_table(read_evaluations(tmp_path))
    assert table.loc[("table_lack", "tstar"), "progress"] == pytest.approx(0.9)


def test_an_arm_costs_its_skills_its_fine_tuning_and_its_trials():
    rows = pd.DataFrame(
        {
            "task": "table",
            "arm": ["plain", "floored", "mended", "mended"],
            "env_steps": [5e5, 6e5, 1.5e6, 2.5e6],
        }
    )
    tried = {"recipe": "mended", "subtask": -1, "trial_progress": 0.5, "accepted": 1, "trial_steps": 1e5}
    metrics = pd.DataFrame(
        [tried | {"seed": seed, "env_steps": step} for seed in (0, 1) for step in (1, 2, 3)]
    )
    untried = pd.DataFrame([{"recipe": "floored", "subtask": -1, "seed": 0, "env_steps": 0}])
    metrics = pd.concat([metrics, untried]).assign(task="table")
    # Two seeds of 1.5M and 2.5M, each with three trials of .1M.
    assert steps_of_arms(rows, metrics).to_dict() == {"plain": 5e5, "floored": 6e5, "mended": 2.3e6}


@pytest.mark.parametrize("tried", [None, 0.5])
def test_steps_before_the_first_turn_count_where_no_trial_ends_that_turn(tried):
    """chain.trial_every=2, or no trial at all: the first row has the steps of chain.seed_episodes alone."""
    rows = pd.DataFrame({"task": "table", "arm": ["mended"], "env_steps": [1.5e6]})
    turns = {"trial_progress": [None, tried], "trial_steps": [2e5, 1e5 if tried else 0]}
    metrics = pd.DataFrame(turns).assign(task="table", recipe="mended", subtask=-1, seed=0, env_steps=[1, 2])
    assert steps_of_arms(rows, metrics).to_dict() == {"mended": 1.8e6 if tried else 1.7e6}
