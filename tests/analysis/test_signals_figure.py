"""What signals told, turn by turn: the rows of turns and the figure of them, by hand."""

import math

import pandas as pd
import pytest
from published_runs import THEIRS

from tstar_rl.analysis import read_metrics
from tstar_rl.analysis.figures import signals_figure
from tstar_rl.analysis.page.drawing import draw_page
from tstar_rl.analysis.page.page import results_page
from tstar_rl.analysis.turns import signal_turns, turn_table


@pytest.fixture
def told(published):
    """T-STAR, two seeds: skills 0 and 1 in two rounds; the last turn is put back, after the second all were alike."""
    turns = {
        "env_steps": [1, 2, 3, 4],
        "skill": [0, 1, 0, 1],
        "round": [0, 0, 1, 1],
        "accepted": [1, 1, 1, 0],
    }
    for seed, first in ((3, 0.5), (4, 0.75)):
        auc = {"d_omega_auc": [first, None, 1.0, 0.25], "d_omega_sd": [0.125, 0.0, 0.25, 0.5]}
        place = published / f"odd/table/tstar/seed{seed}/metrics.csv"
        pd.DataFrame({**turns, **auc, "trial_progress": 0.5}).to_csv(place, index=False)
    return published


def test_a_row_for_each_turn_and_signal(told):
    rows = signal_turns(read_metrics(told / "odd"), "table")
    assert rows["arm"].unique().tolist() == ["tstar"] and rows["signal"].unique().tolist() == ["d_omega"]
    mine = rows[rows["seed"] == 3]
    assert mine[["skill", "round", "kept"]].to_numpy().tolist() == [
        [0, 0, True],
        [1, 0, True],
        [0, 1, True],
        [1, 1, False],
    ]
    assert mine["auc"].fillna(-1).tolist() == [0.5, -1, 1.0, 0.25] and mine["spread"].tolist() == [
        0.125,
        0.0,
        0.25,
        0.5,
    ]


def test_an_interval_stands_beside_the_area(told):
    line = turn_table(read_metrics(told / "odd"), "table").loc["tstar"]
    assert line["auc"] == pytest.approx((0.75 + 0.875) / 2)
    assert line["auc_half"] == pytest.approx(12.706 * 0.0625, abs=1e-3)  # Student, one degree of freedom
    assert "| 0.81 +- 0.79 |" in results_page(told, THEIRS, "")


def test_every_turn_is_a_dot_and_what_was_put_back_is_hollow(told):
    figure = signals_figure(signal_turns(read_metrics(told / "odd"), "table"), {"d_omega": "T-STAR"})
    first, second, spread, _ = figure.axes
    dots = [line for line in first.lines if line.get_linestyle() == "None" and line.get_marker() in "os"]
    assert sorted(line.get_xdata()[0] for line in dots) == [0.5, 0.75, 1.0, 1.0]
    put_back = [
        line for line in second.lines if line.get_marker() in "os" and line.get_markerfacecolor() == "none"
    ]
    assert [line.get_xdata()[0] for line in put_back] == [0.25, 0.25]
    assert (
        len(second.containers) == 0 and len(first.containers) == 1
    )  # no mean where no kept turn told anything
    means = {bar.lines[0].get_xdata()[0] for bar in spread.containers}
    assert means == {0.1875} and not any(math.isnan(mean) for mean in means)
    assert [text.get_text() for text in first.get_yticklabels()] == ["T-STAR"]


def test_the_page_shows_it_where_a_signal_was_judged(told, tmp_path_factory):
    page, drawn = results_page(told, THEIRS, ""), draw_page(told, THEIRS, tmp_path_factory.mktemp("pictures"))
    assert "odd_table_signals.png" in page and "odd_table_signals.png" in {path.name for path in drawn}
    for seed in (3, 4):
        file = told / f"odd/table/tstar/seed{seed}/metrics.csv"
        pd.read_csv(file).drop(columns=["d_omega_auc", "d_omega_sd"]).to_csv(file, index=False)
    assert "odd_table_signals.png" not in results_page(told, THEIRS, "")


def test_many_rounds_go_from_dark_to_light_and_the_key_names_three(told):
    rows = signal_turns(read_metrics(told / "odd"), "table")
    many = pd.concat([rows[rows["round"] == 0].assign(round=number) for number in range(16)])
    figure = signals_figure(many, {"d_omega": "T-STAR"})
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["round 1", "round 9", "round 16"]
    dots = [
        line for line in figure.axes[0].lines if line.get_linestyle() == "None" and line.get_marker() == "o"
    ]
    assert len({line.get_color() for line in dots}) == 16
