"""docs/results.md: that it is what the tables say, and that bad runs stay in it."""

from pathlib import Path

import pandas as pd
import pytest
import yaml

from tstar_rl.analysis.report import curve_groups, other_roots, replace_block, results_head, results_page
from tstar_rl.analysis.report_tables import comparison, over_seeds, skills

ROOT = Path(__file__).resolve().parents[2]
PAPER, NOTES = ROOT / "docs" / "paper_results.yaml", ROOT / "docs" / "results_notes.md"
THEIRS = {
    "tasks": ["table"],
    "systems": {
        "bc": {"label": "BC", "progress": {"table": [0.03, 0.0]}},
        "tstar": {"label": "T-STAR", "progress": {"table": [0.9, 0.07]}, "success": {"table": 0.87}},
        "ours_alone": {"label": "never run"},
    },
}


def evaluation(recipe: str, seed: int, progress: float, checkpoint: str = "last", **more) -> dict:
    row = {"task": "table", "recipe": recipe, "seed": seed, "subtask": -1, "checkpoint": checkpoint}
    return {**row, "mode": "deterministic", "progress": progress, "success": progress, **more}


def test_the_page_and_the_readme_are_what_the_tables_say():
    again = "run: python recipes/report.py"
    page = results_page(ROOT / "results", PAPER, NOTES)
    assert page == (ROOT / "docs" / "results.md").read_text(), again
    readme = (ROOT / "README.md").read_text()
    config = yaml.safe_load((ROOT / "configs" / "recipe" / "report.yaml").read_text())
    head = results_head(ROOT / "results", PAPER, config["readme_folders"])
    assert replace_block(readme, head) == readme, again


def test_mean_and_deviation_over_seeds_by_hand():
    assert over_seeds(pd.Series([0.5, 0.7])) == "0.600 +- 0.141"  # 0.1 sqrt(2)
    assert over_seeds(pd.Series([0.25]), percent=True) == "25.0%"
    assert over_seeds(pd.Series([], dtype=float)) == "-"


def test_bad_runs_and_rows_of_only_one_side_stay():
    rows = [evaluation("tstar", 0, 1.0), evaluation("tstar", 1, 0.0), evaluation("tstar", 0, 0.5, "best")]
    rows.append(evaluation("mine", 0, 0.0))
    table = comparison(pd.DataFrame(rows), THEIRS, "table").splitlines()[2:]
    assert table == [
        "| BC | 0.03 +- 0.00 | - | - | - | - | - | not run |",
        "| T-STAR | 0.90 +- 0.07 | 87% | 0.500 +- 0.707 | 50.0 +- 70.7% | 0.500 | 50.0% | 2 |",
        "| mine | - | - | 0.000 | 0.0% | - | - | 1 |",
    ]


def test_a_skills_steps_are_those_of_its_whole_training():
    kept = {"prior": 0, "best": 1_000_000, "last": 3_000_000}
    rows = [evaluation("spirl", 0, 0.5, name, env_steps=steps) for name, steps in kept.items()]
    rows.append(evaluation("gail_ppo", 0, 0.5, "best", env_steps=1_000_000))
    table = skills(pd.DataFrame(rows).assign(subtask=2), "table").splitlines()[2:]
    assert table == [
        "| gail_ppo, subtask 2 | - | 50.0% | 1.00M | 1 |",
        "| spirl, subtask 2 | 50.0% | 50.0% | 3.00M | 1 |",
    ]


def test_curves_are_sorted_into_skills_chains_and_single_policies():
    rows = [
        {"recipe": "gail_ppo", "subtask": 2, "env_steps": 10},
        {"recipe": "tstar", "subtask": -1, "skill": 0, "env_steps": 10},
        {"recipe": "ppo", "subtask": -1, "env_steps": 10},
        {"recipe": "bc", "subtask": -1, "env_steps": 0},  # one row, no curve
    ]
    groups = curve_groups(pd.DataFrame(rows).assign(task="table"), "table")
    assert {name: list(group.recipe) for name, group in groups.items()} == {
        "skills": ["gail_ppo"],
        "chains": ["tstar"],
        "single_policies": ["ppo"],
    }
    assert curve_groups(pd.DataFrame(rows).assign(task="table"), "chair") == {}


def test_what_was_run_under_other_conditions_has_a_section_of_its_own(tmp_path):
    row = evaluation(
        "tstar", 3, 1.0, success_low=0.9, success_high=1.0, env_steps=5e5, minutes=1, episodes=200
    )
    for place, progress in (("table", 1.0), ("odd/table", 0.25)):
        file = tmp_path / place / "tstar" / "seed3" / "evaluation.csv"
        file.parent.mkdir(parents=True)
        pd.DataFrame([{**row, "progress": progress}]).drop(columns=["task", "recipe", "subtask"]).to_csv(file)
    (tmp_path / "odd" / "README.md").write_text("# Odd chains\n\nOf skills that are odd.\n")
    handed = {"system": "tstar", "seed": 3, "checkpoint": "last", "own_starts": 1.0}
    steps = [{**handed, "subtask": 0}, {**handed, "subtask": 1, "handed_over": 0.5}]
    pd.DataFrame(steps).to_csv(tmp_path / "odd" / "table" / "hand_over.csv", index=False)
    assert other_roots(tmp_path) == [tmp_path / "odd"]
    page = results_page(tmp_path, PAPER, NOTES)
    main, odd = page.split("## Odd chains\n\nOf skills that are odd.\n")
    assert "| T-STAR | - | - | 1.000 |" in main and "0.250" not in main
    assert "| T-STAR | 0.250 | 100.0% | - | - | 0.50M | 1 |" in odd
    assert "| T-STAR, last | 1.00 | 0.50 / 1.00 | 1 |" in odd
    assert "(figures/odd_table_hand_over.png)" in odd
    head = results_head(tmp_path, PAPER, ["odd", "not there"])
    main, odd = head.split("[Odd chains](docs/results.md#odd-chains), `table`\n")
    assert "| T-STAR | 0.250 | 100.0% |" in odd and "0.250" not in main and "Odd" not in main
    assert "odd" not in results_head(tmp_path, PAPER)


def test_the_block_is_replaced_and_nothing_else():
    text = "a\n<!-- results: begin -->\nold\n<!-- results: end -->\nb\n"
    once = replace_block(text, "new")
    assert once == "a\n<!-- results: begin -->\nnew\n<!-- results: end -->\nb\n" == replace_block(once, "new")
    with pytest.raises(ValueError, match="needs one line <!-- results: begin -->"):
        replace_block("nothing", "new")
