"""The figure of a seam's two sides."""

import math

import pandas as pd

from tstar_rl.analysis.figures import sides_figure


def rows(seeds: int) -> pd.DataFrame:
    one = {
        "split_by": "joint 6",
        "split": 0.9,
        "below": 0.25,
        "succeeded_below": 0.1,
        "succeeded_above": 0.95,
    }
    places = [
        (system, seed, seam)
        for system in ("no_finetuning", "tstar")
        for seed in range(seeds)
        for seam in (1, 3)
    ]
    return pd.DataFrame([{"system": a, "seed": b, "subtask": c, **one} for a, b, c in places])


def test_a_seed_has_a_dot_for_each_side_as_large_as_its_share():
    figure = sides_figure(rows(5))
    assert len(figure.axes) == 4
    for axes in figure.axes:
        heights = [float(dots.get_offsets()[0][1]) for dots in axes.collections]
        areas = [float(dots.get_sizes()[0]) for dots in axes.collections]
        assert heights == [0.1, 0.95] * 5
        assert all(math.isclose(low * 3, high) for low, high in zip(areas[::2], areas[1::2], strict=True))
    assert "tstar: skill 3 to 4, joint 6" in {axes.get_title() for axes in figure.axes}


def test_tables_without_two_heaps_say_so():
    nothing = rows(1).assign(split=math.nan)
    for table in (nothing, pd.DataFrame()):
        assert "no states in two heaps" in sides_figure(table).axes[0].texts[0].get_text()
