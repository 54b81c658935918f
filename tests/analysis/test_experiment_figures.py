"""Figures of an experiment: a dot for every seed, arms that are told apart, the same file again."""

import numpy as np

from tstar_rl.analysis import arms_figure, differences_figure, read_experiment, save_figure
from tstar_rl.analysis.figures.panels import arm_dots, arm_line

PAIRS = [("tstar", "buffer"), ("tstar", "not_run")]


def test_every_seed_is_a_dot(two_arms):
    rows = read_experiment(two_arms).chosen("table")
    progress, success, profile = arms_figure(rows, {"tstar": "T-STAR"}).axes
    assert [label.get_text() for label in progress.get_yticklabels()] == ["buffer", "T-STAR"]
    for axes, expected in ((progress, [[0.75, 0.6], [0.95, 0.85]]), (success, [[0.6, 0.4], [0.9, 0.7]])):
        dots = [line.get_xdata() for line in axes.lines if line.get_marker() in ("o", "s")]
        np.testing.assert_allclose(dots, expected)
    above = profile.lines[1].get_ydata()  # T-STAR: both above .8, one above .9, none above .95
    assert [above[80], above[90], above[95]] == [1.0, 0.5, 0.0]
    for line, profiled in zip(
        success.lines[-2:], profile.lines, strict=True
    ):  # each row shows the line of its profile
        assert (line.get_color(), line.get_linestyle()) == (profiled.get_color(), profiled.get_linestyle())


def test_many_arms_are_told_apart():
    lines = {tuple(map(str, arm_line(place).values())) for place in range(35)}
    assert len(lines) == len({tuple(arm_dots(place).values()) for place in range(35)}) == 35


def test_a_difference_has_a_dot_for_every_seed(two_arms):
    rows = read_experiment(two_arms).chosen("table")
    (axes,) = differences_figure(rows, PAIRS, absent_ok=True).axes
    (dots,) = [line.get_xdata() for line in axes.lines if line.get_marker() == "o"]
    np.testing.assert_allclose(dots, [0.2, 0.25])
    half = 12.706 * 0.05 / 2  # Student's, as above; the bootstrap's interval lies within it
    ends = [bar.get_segments()[0][:, 0] for bar in axes.collections]
    np.testing.assert_allclose(ends[0], [0.225 - half, 0.225 + half], atol=1e-3)
    assert ends[0][0] < ends[1][0] < 0.225 < ends[1][1] < ends[0][1]


def test_a_figure_is_the_same_file_again(two_arms, tmp_path):
    rows = read_experiment(two_arms).chosen("table")
    files = [save_figure(arms_figure(rows), tmp_path / f"{name}.png") for name in "ab"]
    assert files[0].read_bytes() == files[1].read_bytes()
