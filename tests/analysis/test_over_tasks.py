"""Arms over several tasks: who has what, the table by hand, the section of the page and its figure."""

import re
from pathlib import Path

import numpy as np
import pytest
from made_up_shelf import PAPER, RUNS, contents, section, write_shelf

from tstar_rl.analysis import read_experiment, tasks_figure, tasks_table
from tstar_rl.analysis.over_tasks import (
    arms_with,
    lacking_seeds,
    lacking_tasks,
    task_sets,
)
from tstar_rl.analysis.page import results_head, results_page
from tstar_rl.analysis.page.contents import read_contents
from tstar_rl.analysis.page.over_tasks import draw_over_tasks


@pytest.fixture
def shelf(tmp_path) -> Path:
    return write_shelf(tmp_path, RUNS)


@pytest.fixture
def gaps(tmp_path) -> Path:
    """The same with a third task that an arm lacks, and a seed that the other lacks there."""
    third = {"base": {1: [0.5, 0.5]}, "late": {1: [1, 1], 2: [1, 1]}}
    runs = {task: {**arms, "late": arms["base"]} for task, arms in RUNS.items()}
    (tmp_path / "gaps").mkdir()
    return write_shelf(tmp_path / "gaps", {**runs, "third": third})


def test_progress_of_tasks_of_any_length_is_a_share(shelf):
    scores = read_experiment(shelf / "shelf").scores()
    assert [list(scores), list(scores["long"])] == [["long", "short"], ["base", "tstar"]]
    # One subtask of four is a quarter, one of two a half.
    assert set(scores["long"]["base"][1]) == {0, 0.25, 0.5, 1} and set(scores["short"]["base"][1]) == {
        0,
        0.5,
        1,
    }
    assert scores["long"]["tstar"][2].mean() == 1 and scores["short"]["tstar"][2].mean() == pytest.approx(0.9)


def test_the_table_by_hand(shelf):
    scores = read_experiment(shelf / "shelf").scores()
    table = tasks_table(scores, ["long", "short"], "base")
    # Of .4 .4 .4 .8 the ends are cut, and of .4 .7 .9 1; of successes .2 .2 .2 .6 and .2 .4 .8 1.
    assert table["progress"].to_dict() == pytest.approx({"base": 0.4, "tstar": 0.8})
    assert table["success"].to_dict() == pytest.approx({"base": 0.2, "tstar": 0.6})
    assert table[["seeds_low", "seeds_high", "runs"]].to_numpy().tolist() == [[2, 2, 4]] * 2
    # Of the long task all four pairs are won; of the short one (.4 .9 against .4 .8) two, and one is a tie.
    assert table.loc["tstar", "improvement"] == pytest.approx((1 + 2.5 / 4) / 2)
    assert table.loc["base", ["improvement", "improvement_low"]].isna().all()
    for name in ("progress", "success", "improvement"):
        row = table.loc["tstar"]
        assert row[f"{name}_low"] < row[name] < row[f"{name}_high"]


def test_improvement_is_of_the_seeds_that_both_have(shelf):
    scores = read_experiment(shelf / "shelf").scores()
    del scores["long"]["base"][1], scores["short"]["base"][2]
    table = tasks_table(scores, ["long", "short"], "base")
    assert table.loc["tstar", "improvement"] == pytest.approx((1 + 0.5) / 2)  # 1 over .4; .4 and .4
    assert table.loc["base", ["seeds_low", "seeds_high"]].tolist() == [1, 1]
    del scores["long"]["tstar"][2]
    assert np.isnan(tasks_table(scores, ["long", "short"], "base").loc["tstar", "improvement"])


def test_what_is_missing_is_found(shelf, gaps):
    whole, partly = (read_experiment(root / "shelf").scores() for root in (shelf, gaps))
    assert task_sets(whole) == [["long", "short"]] and not lacking_tasks(whole) and not lacking_seeds(whole)
    assert task_sets(partly) == [["long", "short", "third"], ["long", "short"]]
    assert arms_with(partly, list(partly)) == ["base", "late"]
    assert lacking_tasks(partly) == {"tstar": ["third"]} and lacking_seeds(partly) == {"base": {"third": [2]}}


def test_tasks_that_no_two_arms_share_are_not_aggregated():
    one = {1: np.ones(3)}
    assert task_sets({"a": {"x": one}, "b": {"y": one}}) == []
    # No arm has all three, and both have two.
    assert task_sets(
        {"a": {"x": one, "y": one}, "b": {"x": one, "y": one}, "c": {"x": one}, "d": {"y": one}}
    ) == [["a", "b"]]


def test_the_page_has_a_section_over_all_tasks(shelf):
    page, found = results_page(shelf, PAPER, ""), section(shelf)
    assert f"\n\n{found}\n\n### The shelf: long\n" in page and found.startswith(
        "### The shelf: over all tasks\n"
    )
    assert "Over all 2 tasks: `long`, `short`." in found and "Missing" not in found
    assert "The reference is no signal." in found and "](figures/shelf_all_tasks.png)" in found
    assert re.search(r"\| no signal \| 2 \| 2 \| 0\.400 \[[^|]+\| 0\.200 \[[^|]+\| - \|\n", found)
    assert re.search(r"\| T-STAR \| 2 \| 2 \| 0\.800 \[[^|]+\| 0\.600 \[[^|]+\| 0\.812 \[[^|]+\|", found)


def test_the_page_says_what_is_missing_and_compares_common_tasks(gaps):
    found = section(gaps)
    assert (
        "- T-STAR has no run of `third`.\n- An arm that lacks a task is compared on the tasks that all"
        in found
    )
    assert "- no signal lacks seed 2 of `third`." in found
    every, common = found.split("Over all 3 tasks, the arms that have every one of them: ")[1].split(
        "Over the 2 tasks that every arm has: `long`, `short`."
    )
    assert (
        "T-STAR" not in every and "| no signal | 3 | 1 to 2 |" in every and "| late start | 3 | 2 |" in every
    )
    assert [line.split(" | ")[0] for line in common.splitlines() if " | 2 | 2 | " in line] == [
        "| no signal",
        "| T-STAR",
        "| late start",
    ]


def test_arms_without_common_tasks_are_said_to_have_none(tmp_path):
    runs = {"long": {"base": RUNS["long"]["base"]}, "short": {"tstar": RUNS["short"]["tstar"]}}
    found = section(write_shelf(tmp_path, runs))
    assert "The arms have fewer than two tasks in common" in found and "|---|" not in found


def test_where_no_arm_has_all_tasks_the_common_ones_are_left(tmp_path):
    late = {"late": RUNS["long"]["base"]}
    runs = {**{task: {**arms, **late} for task, arms in RUNS.items()}, "third": late, "fourth": RUNS["short"]}
    found = section(write_shelf(tmp_path, runs))
    assert "](figures/shelf_common_tasks.png)" in found and "all_tasks" not in found
    assert "Over the 2 tasks that every arm has: `long`, `short`." in found and "Over all" not in found


def test_one_task_has_no_such_section(tmp_path):
    root = write_shelf(tmp_path, {"long": RUNS["long"]})
    contents(root)  # the reference is not asked for
    page = results_page(root, PAPER, "")
    assert "over all tasks" not in page and "### The shelf: long" in page
    (entry,) = read_contents(root).experiments
    assert draw_over_tasks(read_experiment(root / "shelf"), PAPER, entry, tmp_path) == []


def test_the_section_shows_the_figures_that_are_drawn(gaps, tmp_path):
    shown = re.findall(r"\]\(figures/([^)]+)\)", section(gaps))
    (entry,) = read_contents(gaps).experiments
    drawn = draw_over_tasks(read_experiment(gaps / "shelf"), PAPER, entry, tmp_path / "figures")
    assert [file.name for file in drawn] == shown == ["shelf_all_tasks.png", "shelf_common_tasks.png"]


def test_the_notes_and_the_readme_have_the_table(shelf):
    line = re.search(r"\| T-STAR \| 2 \| 2 \|.*", section(shelf))
    assert line
    asked = "<!-- over all tasks: shelf -->"
    assert line[0] in results_page(shelf, PAPER, asked).split("## How to read")[0]
    assert line[0] in results_head(shelf, PAPER, asked)


def test_the_reference_is_one_of_the_arms(shelf):
    contents(shelf, reference="bases")
    with pytest.raises(ValueError, match="reference of shelf must be one of its arms base, tstar, got bases"):
        results_page(shelf, PAPER, "")
    contents(shelf)
    assert read_contents(shelf).experiments[0].reference == "no_finetuning"


def test_every_run_is_a_dot_and_profiles_are_means_over_tasks(shelf):
    scores = read_experiment(shelf / "shelf").scores()
    figure = tasks_figure(scores, ["long", "short"], ["base", "tstar"], {"tstar": "T-STAR"})
    runs, profiles = figure.axes
    assert [label.get_text() for label in runs.get_yticklabels()] == ["base", "T-STAR"]
    dots = [line.get_xdata() for line in runs.lines if line.get_marker() in ("o", "s")]
    np.testing.assert_allclose(dots, [[0.4, 0.4], [0.4, 0.8], [0.7, 1.0], [0.4, 0.9]])
    # T-STAR: above .3 all; above .5 both long ones and one short one; above .8 one of each; above .95 one long one.
    at, above = profiles.lines[1].get_data()
    ends = (0.3, 0.5, 0.8, 0.95, 0.999, 1.0)
    assert [above[np.searchsorted(at, end - 1e-9)] for end in ends] == [1.0, 0.75, 0.5, 0.25, 0.25, 0.0]
    assert (at[0], at[-1]) == (0, 1) and (
        at > 0.99
    ).sum() > 30  # where the axis is stretched a run is a step too
    legends = [[text.get_text() for text in legend.get_texts()] for legend in figure.legends]
    assert legends == [["long", "short"], ["base", "T-STAR"]]


def test_a_figure_of_an_arm_that_lacks_a_task_is_refused(gaps):
    scores = read_experiment(gaps / "shelf").scores()
    with pytest.raises(ValueError, match="need all of long, short, third; not so: tstar"):
        tasks_figure(scores, list(scores), ["base", "tstar"])
