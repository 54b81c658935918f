"""docs/results.md: that it is what the published tables say, and that bad runs stay in it."""

import re
from pathlib import Path

import pandas as pd
import pytest
import yaml

from tstar_rl.analysis import read_metrics, rise_figure
from tstar_rl.analysis.page import curve_groups, draw_page, replace_block, results_head, results_page
from tstar_rl.analysis.page.contents import read_contents
from tstar_rl.analysis.page.markdown import arm_label, arm_order, over_seeds
from tstar_rl.analysis.page.sections import comparison, short_comparison, skills

ROOT = Path(__file__).resolve().parents[2]
PUBLISHED = ROOT / "results" / "published"
PAPER = yaml.safe_load((ROOT / "docs" / "paper_results.yaml").read_text())
NOTES = (ROOT / "docs" / "results_notes.md").read_text()
THEIRS = {
    "tasks": ["table"],
    "systems": {
        "bc": {"label": "BC", "progress": {"table": [0.03, 0.0]}},
        "tstar": {"label": "T-STAR", "progress": {"table": [0.9, 0.07]}, "success": {"table": 0.87}},
        "ours_alone": {"label": "never run"},
    },
    "arms": {"buffer": "buffer starts", "tstar": None},
    "arm_endings": {"_no_gate": "every turn kept", "_paper_schedule": "as in the paper"},
    "hours": 48,
    "workers": 16,
}
COMMIT = "c" * 40


def evaluation(recipe: str, seed: int, progress: float, checkpoint: str = "last", **more) -> dict:
    row = {"task": "table", "recipe": recipe, "seed": seed, "subtask": -1, "checkpoint": checkpoint}
    return {**row, "mode": "deterministic", "progress": progress, "success": progress, **more}


def test_the_page_and_the_readme_are_what_the_published_tables_say():
    again = "run: python recipes/report.py"
    page = results_page(PUBLISHED, PAPER, NOTES)
    assert page == (ROOT / "docs" / "results.md").read_text(), again
    readme = (ROOT / "README.md").read_text()
    assert replace_block(readme, results_head(PUBLISHED, PAPER, NOTES)) == readme, again


def test_every_figure_of_the_page_is_there_and_no_other():
    shown = set(re.findall(r"\]\(figures/([^)]+)\)", (ROOT / "docs" / "results.md").read_text()))
    prefixes = tuple(entry.prefix for entry in read_contents(PUBLISHED).experiments)
    drawn = {
        path.name for path in (ROOT / "docs" / "figures").glob("*.png") if path.name.startswith(prefixes)
    }
    assert shown == drawn


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


def write(root: Path, experiment: str, recipe: str, seed: int, progress: float, **more) -> None:
    """A run of 200 episodes that all complete one of two subtasks, or `progress` of both."""
    folder = root / experiment / "table" / recipe / f"seed{seed}"
    folder.mkdir(parents=True)
    rows = []
    for checkpoint in ("last", "best"):
        row = evaluation(recipe, seed, progress, checkpoint, success_low=0.0, success_high=1.0, env_steps=5e5)
        row |= {"minutes": 1, "episodes": 200, "subtask_0": progress, "subtask_1": progress}
        rows.append({name: value for name, value in row.items() if name not in ("task", "recipe", "subtask")})
    pd.DataFrame(rows).to_csv(folder / "evaluation.csv", index=False)
    (folder / "config.yaml").write_text(yaml.safe_dump({"versions": {"commit": more.get("commit", COMMIT)}}))


@pytest.fixture
def published(tmp_path) -> Path:
    """An experiment of two arms and two seeds, and tables beside the paper's."""
    for seed, progress in ((3, 0.75), (4, 0.5)):
        write(tmp_path, "odd", "tstar", seed, progress)
        write(tmp_path, "odd", "buffer_no_gate", seed, progress - 0.25)
    write(tmp_path, "plain", "tstar", 0, 1.0)
    own = {"system": "tstar", "checkpoint": "last", "own_starts": 1.0}
    steps = [{**own, "seed": seed, "subtask": 0} for seed in (3, 4)]
    steps += [{**own, "seed": seed, "subtask": 1, "handed_over": 0.5} for seed in (3, 4)]
    pd.DataFrame(steps).to_csv(tmp_path / "odd" / "table" / "hand_over.csv", index=False)
    (tmp_path / "odd" / "README.md").write_text("# Odd chains\n\nOf skills that are odd.\n")
    (tmp_path / "plain" / "README.md").write_text("# Plain: chains\n\nAs in the paper.\n")
    odd = {"folder": "odd", "kind": "experiment", "pairs": [["tstar", "buffer_no_gate"]]}
    contents(tmp_path, [odd, {"folder": "plain", "kind": "paper"}], ["odd", "plain"])
    return tmp_path


def contents(root: Path, experiments: list[dict], readme: list[str]) -> None:
    (root / "contents.yaml").write_text(yaml.safe_dump({"experiments": experiments, "readme": readme}))


def test_an_experiment_has_arms_comparisons_and_its_commit(published):
    page = results_page(published, THEIRS, "Found.\n\nMore.")
    odd, plain = page.split("## Odd chains\n\nOf skills that are odd.\n")[1].split("\n## Plain: chains")
    assert "All arms come from commit ccccccc." in odd
    # T-STAR: the mean of .75 and .5; its skills do all of their own starts, so the gap is 1 - .625.
    assert re.search(
        r"\| T-STAR \| 2 \| 0\.625 \[0\.\d\d, 0\.\d\d\] .*\| 0\.75 0\.50 \| - \| 1\.000 \| 0\.375 \|", odd
    )
    assert "| buffer starts, every turn kept | 2 | 0.375 [" in odd
    # Both seeds differ by .25; four pairs of seeds: three wins and a tie.
    assert re.search(
        r"\| T-STAR less buffer starts, every turn kept \| 2 \| \+0\.250 .* \| 0\.875 .* \| higher \|", odd
    )
    assert "| T-STAR, last | 1.00 | 0.50 / 1.00 | 2 |" in odd
    assert "| T-STAR | 0.90 +- 0.07 | 87% | 1.000 |" in plain and "0.625" not in plain
    assert "| T-STAR | - | - | 0.50M | 1.0 |" in plain


def test_a_family_of_comparisons_is_corrected_for_all_of_it(published):
    write(published, "odd", "buffer", 3, 0.5)
    write(published, "odd", "buffer", 4, 0.375)
    pairs = [["tstar", "buffer_no_gate"], ["tstar", "buffer"], ["buffer", "buffer_no_gate"]]
    odd = {
        "folder": "odd",
        "kind": "experiment",
        "pairs": pairs,
        "family": [["tstar", "buffer"], ["tstar", "mine"]],
    }
    contents(published, [odd, {"folder": "plain", "kind": "paper"}], [])
    with pytest.raises(ValueError, match=r"family of odd has \[\('tstar', 'mine'\)\], not in its pairs"):
        read_contents(published)
    pairs.append(["tstar", "mine"])
    contents(published, [odd, {"folder": "plain", "kind": "paper"}], [])
    page = results_page(published, THEIRS, "")
    # Differences .25 and .125: t = 3 with one degree of freedom has p = .2048; twice that, for the pair not run counts.
    assert re.search(r"\| T-STAR less buffer starts \| 2 \|.*\| 0\.410 \| not told apart \|", page)
    assert re.search(
        r"\| buffer starts less buffer starts, every turn kept \| 2 \|.*\| - \| not told apart \|", page
    )


def test_the_turns_of_an_experiment_by_hand(published):
    turns = {
        "trial_progress": [0.5, None, 0.75],
        "accepted": [0, None, 1],
        "trial_steps": [400_000, None, 200_000],
    }
    for seed, auc in ((3, [0.5, None, None]), (4, [0.6, None, 0.8])):
        place = published / "odd" / "table"
        rows = pd.DataFrame(turns).assign(env_steps=[1, 2, 3], skill=0)
        rows.assign(d_omega_auc=auc).to_csv(place / f"tstar/seed{seed}/metrics.csv", index=False)
        rows.to_csv(place / f"buffer_no_gate/seed{seed}/metrics.csv", index=False)
    page = results_page(published, THEIRS, "")
    assert "| T-STAR | 2 | 2 | 0.625 | 0.50 | 0.60 | 0.60M |" in page
    assert "| buffer starts, every turn kept | 2 | 2 | 0.625 | 0.50 | - | 0.60M |" in page
    drawn = draw_page(published, THEIRS, published / "figures")
    assert "odd_table_rise.png" in page and published / "figures/odd_table_rise.png" in drawn
    (axes,) = rise_figure(read_metrics(published / "odd"), "table", {"tstar": "T-STAR"}).axes
    one, other, mean = (line.get_xydata().tolist() for line in axes.lines)
    assert one == other == mean == [[1, 0.5], [3, 0.75]]


def test_the_page_shows_the_figures_that_are_drawn(published, tmp_path):
    shown = re.findall(r"\]\(figures/([^)]+)\)", results_page(published, THEIRS, ""))
    drawn = draw_page(published, THEIRS, tmp_path / "figures")
    assert sorted(path.name for path in drawn) == sorted(shown) and len(shown) == 3


def test_notes_get_the_tables_that_they_ask_for(published):
    page = results_page(published, THEIRS, "Found.\n\n<!-- table: odd -->\n\n<!-- comparisons: odd -->")
    lead = page.split("## How to read the tables")[0]
    assert "| T-STAR | 0.625 [" in lead and "| T-STAR less buffer starts, every turn kept |" in lead
    with pytest.raises(ValueError, match="table: plain -->: there is no such experiment; there are odd"):
        results_page(published, THEIRS, "<!-- table: plain -->")


def test_the_readme_has_the_first_paragraph_and_short_tables(published):
    head = results_head(published, THEIRS, "Found.\n\nMore.")
    assert (
        head.startswith("Found.\n\n[Odd chains](docs/results.md#odd-chains), `table`") and "More" not in head
    )
    assert re.search(r"\| T-STAR \| 0\.625 \[[^|]+\| 0\.625 \[[^|]+\| 0\.375 \| 2 \|", head)
    assert "[Plain: chains](docs/results.md#plain-chains)" in head
    assert "| T-STAR | 0.90 +- 0.07 | 1.000 |" in head
    contents(published, yaml.safe_load((published / "contents.yaml").read_text())["experiments"], ["plain"])
    assert "Odd" not in results_head(published, THEIRS, "Found.")


def test_arms_of_several_commits_are_refused_unless_the_contents_say_so(published):
    write(published, "odd", "buffer", 3, 0.5, commit="d" * 40)
    with pytest.raises(ValueError, match="must come from one commit, got .*ddddddd: table/buffer/seed3"):
        results_page(published, THEIRS, "")
    odd = {"folder": "odd", "kind": "experiment", "commits": "several"}
    contents(published, [odd, {"folder": "plain", "kind": "paper"}], [])
    page = results_page(published, THEIRS, "")
    assert "The arms come from several commits:" in page
    assert "- ddddddd: `table/buffer` (seed 3)" in page and "`table/tstar` (seed 3, 4)" in page


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"kind": "arms"}, "kind of odd must be one of experiment, paper, ablations, got arms"),
        ({"commits": "any"}, "commits of odd must be one of one, several, got any"),
        ({"pair": []}, "an experiment has no pair; it has folder, kind, commits, pairs"),
    ],
)
def test_mistakes_in_the_contents_are_named(published, change, message):
    contents(
        published,
        [{"folder": "odd", "kind": "experiment", **change}, {"folder": "plain", "kind": "paper"}],
        [],
    )
    with pytest.raises(ValueError, match=message):
        read_contents(published)


def test_no_published_experiment_is_forgotten(published):
    contents(published, [{"folder": "odd", "kind": "experiment"}], [])
    with pytest.raises(ValueError, match="leaves out plain"):
        read_contents(published)
    (published / "odd" / "README.md").unlink()
    with pytest.raises(FileNotFoundError, match="README.md gives an experiment's title"):
        read_contents(published)


def test_arms_stand_in_the_order_of_the_file_with_their_variants():
    found = ["other", "tstar", "buffer_no_gate", "buffer", "tstar_no_gate"]
    expected = ["buffer", "buffer_no_gate", "tstar", "tstar_no_gate", "other"]
    assert arm_order(THEIRS, found) == expected


def test_an_arm_is_called_by_its_name_and_its_endings():
    assert arm_label(THEIRS, "tstar_paper_schedule_no_gate") == "T-STAR, as in the paper, every turn kept"
    assert arm_label(THEIRS, "mine_no_gate") == "mine, every turn kept"


def test_the_short_comparison_leaves_out_what_neither_side_has():
    rows = [evaluation("tstar", 0, 1.0), evaluation("tstar", 1, 0.0)]
    table = short_comparison(pd.DataFrame(rows), THEIRS, ["table"]).splitlines()
    assert table[2:] == ["| BC | 0.03 +- 0.00 | - |", "| T-STAR | 0.90 +- 0.07 | 0.500 +- 0.707 |"]


def test_the_block_is_replaced_and_nothing_else():
    text = "a\n<!-- results: begin -->\nold\n<!-- results: end -->\nb\n"
    once = replace_block(text, "new")
    assert once == "a\n<!-- results: begin -->\nnew\n<!-- results: end -->\nb\n" == replace_block(once, "new")
    with pytest.raises(ValueError, match="needs one line <!-- results: begin -->"):
        replace_block("nothing", "new")
