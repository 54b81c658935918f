"""An experiment on the page: its arms, comparisons, questions and turns."""

import re
import shutil
from types import SimpleNamespace

import pandas as pd
import pytest
from published_runs import COMMIT, THEIRS, contents, write

from tstar_rl.analysis import read_metrics, rise_figure
from tstar_rl.analysis.page import draw_page, results_head, results_page, runs_page
from tstar_rl.analysis.page.commits import commits
from tstar_rl.analysis.page.contents import read_contents
from tstar_rl.analysis.page.sections import hand_over
from tstar_rl.runs.csv_tables import LogError


def test_an_experiment_has_arms_comparisons_and_its_commit(published):
    page = results_page(published, THEIRS, "Found.\n\nMore.")
    odd, plain = page.split("## Odd chains\n\nOf skills that are odd.\n")[1].split("\n## Plain: chains")
    assert "All runs come from commit ccccccc." in odd
    # T-STAR: the mean of .75 and .5; its skills do all of their own starts, so the gap is 1 - .625, and Student's
    # interval of .25 and .5 with one degree of freedom 12.71 times .125 wide to each side. Best is as last.
    assert re.search(
        r"\| T-STAR \| 2 \| 0\.625 \[0\.\d\d, 0\.\d\d\] .*\| 0\.75 0\.50 \| - \| 0\.625 \| 1\.000 \| 0\.375 \+- 1\.588",
        odd,
    )
    assert "| buffer starts, every turn kept | 2 | 0.378 [" in odd
    # The seeds differ by .25 and .245; four pairs of seeds: three wins and a tie.
    assert re.search(
        r"\| T-STAR minus buffer starts, every turn kept \| 2 \| 2 \| \+0\.247 .* \| 0\.875 \| higher \|",
        odd,
    )
    assert "| T-STAR, last | 1.00 | 0.50 / 1.00 | 2 |" in odd
    assert "| T-STAR | 0.90 +- 0.07 | 87% | 1.000 |" in plain and "0.625" not in plain
    assert "| T-STAR | - | - | 0.50M | 1.0 |" in plain


def test_every_run_has_its_row_on_a_page_of_its_own(published):
    odd, plain = runs_page(published, THEIRS).split("\n## Odd chains\n")[1].split("\n## Plain: chains\n")
    rows = [line.split(" | ")[:4] for line in odd.splitlines() if "| last |" in line]
    assert rows == [
        ["| T-STAR", "3", "last", "0.750"],
        ["| T-STAR", "4", "last", "0.500"],
        ["| buffer starts, every turn kept", "3", "last", "0.500"],
        ["| buffer starts, every turn kept", "4", "last", "0.255"],
    ]
    assert "| T-STAR | 0 | last | 1.000 |" in plain
    page = results_page(published, THEIRS, "")
    assert "[Every run of it](every_run.md#odd-chains)" in page and "| T-STAR | 3 |" not in page


def test_a_family_of_comparisons_is_corrected_for_all_of_it(published):
    write(published, "odd", "buffer", 3, 0.5)
    write(published, "odd", "buffer", 4, 0.375)
    pairs = [["tstar", "buffer_no_gate"], ["tstar", "buffer"], ["buffer", "buffer_no_gate"]]
    odd = {
        "folder": "odd",
        "kind": "experiment",
        "pairs": pairs,
        "families": [[["tstar", "buffer"], ["tstar", "mine"]]],
    }
    contents(published, [odd, {"folder": "plain", "kind": "paper"}])
    with pytest.raises(ValueError, match=r"odd: families have \[\('tstar', 'mine'\)\], not in its pairs"):
        read_contents(published)
    pairs.append(["tstar", "mine"])
    asked = {"asks": "Better?", "pairs": [["tstar", "buffer_no_gate"]], "seeds": 2, "improvement": 0.95}
    contents(published, [{**odd, "questions": [asked]}, {"folder": "plain", "kind": "paper"}])
    with pytest.raises(
        ValueError, match=r"improvement ask for \[\('tstar', 'buffer_no_gate'\)\], which no family"
    ):
        read_contents(published)
    twice = {**odd, "families": [[["tstar", "buffer"]]] * 2}
    contents(published, [twice, {"folder": "plain", "kind": "paper"}])
    with pytest.raises(ValueError, match=r"odd: families share \[\('tstar', 'buffer'\)\]"):
        read_contents(published)
    contents(published, [odd, {"folder": "plain", "kind": "paper"}])
    page = results_page(published, THEIRS, "")
    # Differences .25 and .125: t = 3 with one degree of freedom has p = .2048; twice that, for the pair not run counts.
    assert re.search(r"\| T-STAR minus buffer starts \| 2 \|.*\| 0\.410 \| no clear difference \|", page)
    assert re.search(
        r"\| buffer starts minus buffer starts, every turn kept \| 2 \|.*\| - \| no clear difference \|", page
    )


def test_declared_questions_are_answered_when_their_seeds_are_there(published):
    pair = [["tstar", "buffer_no_gate"]]
    odd = {"folder": "odd", "kind": "experiment", "pairs": [*pair, ["tstar", "mine"]], "families": [pair]}
    odd["questions"] = [
        {"asks": "Is it higher?", "pairs": pair, "seeds": 2},
        {"asks": "Is it better?", "pairs": pair, "seeds": 2, "improvement": 0.95},
        {"asks": "By how much?", "pairs": pair, "seeds": 3, "margin": 0.5},
        {"asks": "And mine?", "pairs": [["tstar", "mine"]], "seeds": 1},
    ]
    contents(published, [odd, {"folder": "plain", "kind": "paper"}])
    page = results_page(published, THEIRS, "Found:\n\n<!-- answers: odd -->")
    lead, rest = page.split("## How to read the tables")
    for part in (lead, rest):  # seeds differ by .25 and .245; the probability of improvement is .875
        assert re.search(r"\| Is it higher\? \| \+0\.247 \[[^|]+\| \*\*yes\*\* \|", part)
        assert re.search(r"\| Is it better\? \| \+0\.247 \[[^|]+\| \*\*not shown\*\* \|", part)
        assert "| **measured so far: 2 of 3 seeds** |" in part
        assert "| And mine? | - | **measured so far: 0 of 1 seeds** |" in part


def test_the_turns_of_an_experiment_by_hand(published):
    turns = {
        "trial_progress": [0.5, None, 0.75],
        "accepted": [0, None, 1],
        "trial_steps": [400_000, None, 200_000],
    }
    for seed, auc in ((3, [0.5, None, None]), (4, [0.6, None, 0.8])):
        place = published / "odd" / "table"
        rows = pd.DataFrame(turns).assign(env_steps=[1, 2, 3], skill=0)
        spread = [each and each / 10 for each in auc]
        rows.assign(d_omega_auc=auc, d_omega_sd=spread).to_csv(
            place / f"tstar/seed{seed}/metrics.csv", index=False
        )
        rows.to_csv(place / f"buffer_no_gate/seed{seed}/metrics.csv", index=False)
    page = results_page(published, THEIRS, "")
    assert (
        "| T-STAR | 2 | 2 | 0.625 | 0.50 | 0.80 (1 of 2 seeds) | 0.08 | 0.60M |" in page
    )  # one seed has a kept turn's: no interval
    assert "| buffer starts, every turn kept | 2 | 2 | 0.625 | 0.50 | - | - | 0.60M |" in page
    drawn = draw_page(published, THEIRS, published / "figures")
    for name in ("odd_table_rise.png", "odd_table_costs.png"):
        assert name in page and published / "figures" / name in drawn
    entries = [
        {"folder": name, "kind": "experiment", "figure_arms": ["of_another_task"]}
        for name in ("odd", "plain")
    ]
    shutil.rmtree(published / "figures")
    contents(published, entries)
    assert published / "figures" / "odd_table_costs.png" in draw_page(
        published, THEIRS, published / "figures"
    )
    (axes,) = rise_figure(read_metrics(published / "odd"), "table", {"tstar": "T-STAR"}).axes
    one, other, mean = (line.get_xydata().tolist() for line in axes.lines)
    assert one == other == mean == [[1, 0.5], [3, 0.75]]
    another = pd.DataFrame({"trial_progress": [0.75, 1.0, 1.0], "env_steps": [2, 4, 5], "skill": 0})
    another.to_csv(
        published / "odd/table/tstar/seed4/metrics.csv", index=False
    )  # other steps, and a trial more
    (axes,) = rise_figure(read_metrics(published / "odd"), "table", {"tstar": "T-STAR"}).axes
    one, other, mean = (line.get_xydata().tolist() for line in axes.lines)
    assert (one, other) == ([[1, 0.5], [3, 0.75]], [[2, 0.75], [4, 1], [5, 1]])
    assert mean == [[1.5, 0.625], [3.5, 0.875]]
    many = pd.DataFrame({"trial_progress": 0.5, "env_steps": range(1, 33), "skill": 0})
    many.to_csv(published / "odd/table/tstar/seed4/metrics.csv", index=False)
    (axes,) = rise_figure(read_metrics(published / "odd"), "table", {"tstar": "T-STAR"}).axes
    assert [line.get_xdata()[0] for line in axes.lines[:4]] == [4, 8, 16, 32] and len(axes.lines) == 7


def test_the_page_shows_the_figures_that_are_drawn(published, tmp_path):
    shown = re.findall(r"\]\(figures/([^)]+)\)", results_page(published, THEIRS, ""))
    drawn = draw_page(published, THEIRS, tmp_path / "figures")
    assert sorted(path.name for path in drawn) == sorted(shown) and len(shown) == 3


def test_an_arm_may_have_no_gap_and_a_rule_for_better_shows_what_decides(published):
    asked = {"asks": "Better?", "pairs": [["tstar", "buffer_no_gate"]], "seeds": 2, "improvement": 0.95}
    odd = {"folder": "odd", "kind": "experiment", "pairs": asked["pairs"], "families": [asked["pairs"]]}
    contents(published, [{**odd, "questions": [asked]}, {"folder": "plain", "kind": "paper"}])
    assert "| 1.000 | 0.375 +- 1.588 |" in results_page(published, THEIRS, "")
    contents(
        published, [{**odd, "questions": [asked], "no_gap": ["tstar"]}, {"folder": "plain", "kind": "paper"}]
    )
    page = results_page(published, THEIRS, "")
    assert "| 0.75 0.50 | - | 0.625 | - | - |" in page and "| 1.000 | 0.375" not in page
    assert re.search(r"\| Better\? \| \+0\.247 \[.*\], improvement 0\.88, p = 0\.006 \| \*\*not shown", page)


def test_the_interval_of_an_answer_is_the_wider_of_two(published):
    """Differences of .25 and .125: Student's half is 12.706 deviations of .0884, over the root of two: .794."""
    write(published, "odd", "buffer", 3, 0.5)
    write(published, "odd", "buffer", 4, 0.375)
    asked = {"asks": "Does it help?", "pairs": [["tstar", "buffer"]], "seeds": 2, "margin": 0.05}
    odd = {"folder": "odd", "kind": "experiment", "pairs": asked["pairs"], "questions": [asked]}
    contents(published, [odd, {"folder": "plain", "kind": "paper"}])
    assert "| Does it help? | +0.188 [-0.607, +0.982] |" in results_page(published, THEIRS, "")


def test_an_experiment_may_call_an_arm_otherwise(published):
    odd = {"folder": "odd", "kind": "experiment", "arms": {"buffer": "other starts"}}
    contents(published, [odd, {"folder": "plain", "kind": "paper"}])
    pages = results_page(published, THEIRS, "<!-- table: odd -->"), runs_page(published, THEIRS)
    for page in (*pages, results_head(published, THEIRS, "<!-- table: odd -->")):
        assert "| other starts, every turn kept | " in page and "buffer starts" not in page


def test_only_what_was_changed_after_its_skills_were_tried_has_a_star(published):
    for system in ("no_finetuning", "floored"):
        write(published, "odd", system, 3, 0.5)
    for subtask in (0, 1):
        folder = published / "odd" / "table" / "gail_ppo" / "seed3" / f"subtask{subtask}"
        folder.mkdir(parents=True)
        alone = {"checkpoint": "last", "mode": "deterministic", "success": 0.5, "env_steps": 1, "episodes": 2}
        pd.DataFrame([alone]).to_csv(folder / "evaluation.csv", index=False)
        (folder / "config.yaml").write_text(f"versions: {{commit: {COMMIT}}}\n")
    lead = results_page(published, THEIRS, "<!-- table: odd -->").split("## How to read")[0]
    rows = {
        line.split(" | ")[0].strip("| "): line.split(" | ")[3] for line in lead.splitlines() if " | " in line
    }
    # The product of .5 and .5 is a progress of (.5 + .25) / 2.
    assert (rows["no_finetuning"], rows["floored"]) == ("-0.125", "-0.125 \\*")


def test_arms_of_several_commits_are_refused_unless_the_contents_say_so(published):
    write(published, "odd", "buffer", 3, 0.5, commit="d" * 40)
    with pytest.raises(ValueError, match="must come from one commit, got .*ddddddd: table/buffer/seed3"):
        results_page(published, THEIRS, "")
    odd = {"folder": "odd", "kind": "experiment", "commits": "several"}
    contents(published, [odd, {"folder": "plain", "kind": "paper"}])
    page = results_page(published, THEIRS, "")
    assert "The runs come from several commits:" in page
    assert "- ddddddd: `table`: `buffer` (seed 3)" in page and "`tstar` (seed 3, 4)" in page


def test_the_skills_of_an_arm_stand_with_its_task():
    runs = {
        "c" * 40: ["table/tstar/seed3"],
        "d" * 40: [f"table/wider/gail_ppo/seed{seed}" for seed in (3, 4)],
    }
    said = commits(SimpleNamespace(commits=lambda: runs))
    assert "- ddddddd: `table`: `wider/gail_ppo` (seed 3, 4)\n" in said


def test_a_table_that_was_cut_off_is_not_shown(tmp_path):
    (tmp_path / "table").mkdir()
    (tmp_path / "table/hand_over.csv").write_text("system,seed\ntstar,3\ntstar")
    with pytest.raises(LogError, match="hand_over.csv is damaged"):
        hand_over(tmp_path, "table", THEIRS, "")


@pytest.mark.parametrize(
    ("field", "message"),
    [
        ({"sections": ["tabel"]}, "sections of odd have tabel; there are table"),
        ({"no_gap": ["tstra"]}, "no_gap of odd have tstra; there are buffer_no_gate, tstar"),
        ({"figure_arms": ["tstar", "x"]}, "figure_arms of odd have x; there are"),
    ],
)
def test_a_task_or_an_arm_that_there_is_not_is_told(published, field, message):
    contents(
        published, [{"folder": "odd", "kind": "experiment", **field}, {"folder": "plain", "kind": "paper"}]
    )
    with pytest.raises(ValueError, match=message):
        results_page(published, THEIRS, "")
