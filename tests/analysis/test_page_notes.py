"""What the notes of the page ask for: tables, choices, findings, and the lead that README shows."""

import re
import shutil

import pytest
import yaml
from published_runs import THEIRS, contents, write

from tstar_rl.analysis.page import draw_page, results_head, results_page


def test_notes_get_the_tables_that_they_ask_for(published):
    page = results_page(published, THEIRS, "Found.\n\n<!-- table: odd -->\n\n<!-- comparisons: odd -->")
    lead = page.split("## How to read the tables")[0]
    assert "| T-STAR | 0.625 [" in lead and "| T-STAR minus buffer starts, every turn kept |" in lead
    with pytest.raises(ValueError, match="table: plain -->: there is no such experiment; there are odd"):
        results_page(published, THEIRS, "<!-- table: plain -->")


def test_what_each_choice_adds_is_said_in_the_words_of_the_contents(published):
    odd = {"folder": "odd", "kind": "experiment"}
    for seed, progress in ((3, 0.76), (4, 0.5)):
        write(published, "odd", "nearly", seed, progress)
        write(published, "odd", "sure", seed, 1.0)
        write(published, "odd", "as_sure", seed, 1.0)
    write(published, "odd", "alone", 3, 0.75)
    odd["choices"] = {
        "d_omega and a gate": ["tstar", "buffer_no_gate"],
        "hardly anything": ["nearly", "tstar"],
        "nothing": ["sure", "as_sure"],
        "one seed": ["alone", "tstar"],
        "what was not run": ["tstar", "buffer"],
    }
    contents(published, [odd, {"folder": "plain", "kind": "paper"}])
    page = results_page(published, THEIRS, "<!-- choices: odd -->")
    rows = [line.strip("| ").split(" | ") for line in page.split("| what is chosen |")[1].splitlines()]
    rows = {row[0]: row[1:] for row in rows}
    # Both seeds differ by .25, so that Student's interval is a point.
    assert rows["d_omega and a gate"][1:] == ["+0.216 to +0.279", "2", "higher"]
    assert rows["d_omega and a gate"][0].startswith("+0.247 [")
    # .01 and 0: half of 12.7 deviations of .0071, over the root of two, is .064.
    assert rows["hardly anything"][1:] == ["-0.059 to +0.069", "2", "no clear difference"]
    assert rows["nothing"] == ["+0.000 [+0.000, +0.000]", "+0.000 to +0.000", "2", "within 0.05 of zero"]
    assert rows["one seed"][1:] == ["-", "1", "one seed"]
    assert "what was not run" not in rows
    drawn = draw_page(published, THEIRS, published / "figures")
    assert published / "figures" / "odd_table_choices.png" in drawn
    shutil.rmtree(published / "figures")  # every folder there is an experiment's
    odd["choices"] = {"what was not run": ["tstar", "buffer"]}
    contents(published, [odd, {"folder": "plain", "kind": "paper"}])
    names = [path.name for path in draw_page(published, THEIRS, published / "figures")]
    assert names and "odd_table_choices.png" not in names


def test_the_readme_has_what_the_notes_begin_with_and_its_tables(published):
    notes = (
        "Found [so](#so).\n\n![Drawn.](figures/a.png) [Site](https://a.b)\n\n<!-- table: odd -->\n\n## More\n"
    )
    head = results_head(published, THEIRS, notes)
    lead = "Found [so](docs/results.md#so).\n\n![Drawn.](docs/figures/a.png) [Site](https://a.b)"
    assert head.startswith(f"{lead}\n\n| chain |") and "ore" not in head
    assert re.search(r"\| T-STAR \| 0\.625 \[[^|]+\| 0\.625 \[[^|]+\| 0\.375 \+- 1\.588 \| 2 \|", head)
    assert "| buffer starts, every turn kept |" in head


def test_goals_and_who_reaches_them_by_hand(published):
    """T-STAR makes .75 and .5, the other .5 and .255: of four pairs of seeds it is ahead in three, even in one."""
    goals = {"progress": 0.6, "success": 0.7, "sampled": 0.1, "improvement": 0.8, "over": ["buffer_no_gate"]}
    entries = yaml.safe_load((published / "contents.yaml").read_text())["experiments"]
    (odd,) = (one for one in entries if one["folder"] == "odd")
    contents(published, [{**one, "goals": goals} if one is odd else one for one in entries])
    shown = results_head(published, THEIRS, "<!-- goals: odd -->")
    assert (
        "| progress (goal 0.60) | whole task (goal 0.70) | sampled actions: progress (goal 0.10) |" in shown
    )
    assert "| improvement over buffer starts, every turn kept (goal 0.80) | environment steps |" in shown
    assert "| T-STAR | 2 | **0.625** | 0.625 | - | **0.875** | 0.50M |" in shown
    other = "| buffer starts, every turn kept | 2 | 0.378 | 0.378 | - | - | 0.50M |"
    assert other in shown and other not in results_head(published, THEIRS, "<!-- goals: odd: tstar -->")
    with pytest.raises(ValueError, match="table has no arm bc; it has"):
        results_head(published, THEIRS, "<!-- goals: odd: bc -->")


def test_systems_of_two_experiments_stand_beside_the_papers(published):
    with pytest.raises(
        ValueError, match="beside the paper: tstar is in plain and in odd, whose seeds would be one"
    ):
        results_head(published, THEIRS, "<!-- beside the paper: odd: plain -->")
    (published / "plain/table/tstar").rename(published / "plain/table/bc")
    shown = results_head(published, THEIRS, "<!-- beside the paper: odd: plain -->").splitlines()
    assert shown[2] == "| BC | 0.03 +- 0.00 | - | 1.00 | 1.00 | 1.00 | 1 | 0.50M |"
    # T-STAR makes .75 and .5: mean .625, Student's half 12.706 times .125.
    assert (
        shown[3] == "| T-STAR | 0.90 +- 0.07 | 87% | 0.62 +- 1.59 | 0.62 +- 1.59 | 0.62 +- 1.59 | 2 | 0.50M |"
    )
    assert shown[4].startswith("| buffer starts, every turn kept | - | - | 0.38 +- ") and len(shown) == 5


def test_the_readme_has_less_than_the_pages_lead(published):
    notes = "Found.\n\n<!-- more -->\n\nAnd why.\n\n## More\n"
    assert results_head(published, THEIRS, notes) == "Found."
    assert "Found.\n\nAnd why.\n\n## More" in results_page(published, THEIRS, notes)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ("<!-- tables: odd -->", "comment that is no table: <!-- tables: odd -->"),
        ("<!-- table: odd: tstar-x -->", "comment that is no table"),
        ("<!-- comparisons: odd: tstar -->", "comparisons are of all arms"),
        ("<!-- choices: odd -->", "<!-- choices: odd -->: there is nothing to show"),
    ],
)
def test_what_the_notes_ask_for_is_shown_or_refused(published, asked, message):
    with pytest.raises(ValueError, match=message):
        results_head(published, THEIRS, asked)


def test_the_page_lists_what_was_found(published):
    notes = "<!-- findings -->\n\n### 1. It is `so`: yes.\n\nText.\n\n### 2. Not that.\n\n## More\n"
    page = results_page(published, THEIRS, notes)
    assert "- [1. It is `so`: yes.](#1-it-is-so-yes)\n- [2. Not that.](#2-not-that)\n\n### 1. It is" in page


def test_a_table_has_the_arms_that_the_notes_name(published):
    head = results_head(published, THEIRS, "<!-- table: odd: tstar -->")
    assert "| T-STAR | 0.625" in head and "buffer" not in head
    with pytest.raises(ValueError, match="table has no arm mine; it has buffer_no_gate, tstar"):
        results_page(published, THEIRS, "<!-- table: odd: tstar, mine -->")
    with pytest.raises(ValueError, match="<!-- table: plain -->: there is no such experiment; there are odd"):
        results_page(published, THEIRS, "<!-- table: plain -->")
