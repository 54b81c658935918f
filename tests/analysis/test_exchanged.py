"""What the first skill's ends and the second's taking over add, on numbers made by hand."""

import math
import re

import pandas as pd
import pytest
from published_runs import THEIRS, contents

from tstar_rl.analysis.exchanged import effects_of_seeds, exchange_effects
from tstar_rl.analysis.figures import effects_figure
from tstar_rl.analysis.page import results_page
from tstar_rl.checks import InvalidValueError


def seam(seed: int, **taken: int) -> list[dict]:
    """Rows of one seam of 100 episodes: how many of 100 hand-overs are taken, by <handed_by>_<taken_by>."""
    return [
        {"subtask": 1, "seed": seed, "handed_by": first, "taken_by": second, "handed": 100, "taken": number}
        for (first, second), number in ((name.split("_"), number) for name, number in taken.items())
    ]


def test_two_effects_by_hand_over_two_seeds():
    one = seam(0, after_after=90, before_after=70, after_before=80, before_before=60)
    other = seam(1, after_after=80, before_after=40, after_before=80, before_before=60)
    found = exchange_effects(pd.DataFrame(one + other)).set_index("effect")
    # ends: (.2 + .2) / 2 = .2 and (.4 + .2) / 2 = .3; taking over: (.1 + .1) / 2 = .1 and (0 - .2) / 2 = -.1
    assert found.value.to_dict() == pytest.approx({"ends": 0.25, "taking over": 0.0, "both": 0.25})
    assert found.t_half["ends"] == pytest.approx(
        12.706 * 0.05, abs=1e-4
    )  # a deviation of .1 / sqrt 2, two seeds
    assert found.p_value["taking over"] == pytest.approx(1.0)
    assert (found.seeds == 2).all() and (found.subtask == 1).all()
    assert found.low["ends"] < 0.25 < found.high["ends"] and found.verdict["ends"] == "no clear difference"
    by_seed = effects_of_seeds(pd.DataFrame(one + other)).pivot(
        index="seed", columns="effect", values="value"
    )
    assert by_seed["ends"].tolist() == pytest.approx([0.2, 0.3])
    assert by_seed["taking over"].tolist() == pytest.approx([0.1, -0.1])


def test_what_all_seeds_show_is_higher():
    rows = []
    for seed in range(8):
        rows += seam(seed, after_after=95 - seed, before_after=55, after_before=90, before_before=50)
    found = exchange_effects(pd.DataFrame(rows)).set_index("effect")
    # ends: .4 less half of seed / 100; taking over: .05 less half of seed / 100
    assert found.value.to_dict() == pytest.approx({"ends": 0.3825, "taking over": 0.0325, "both": 0.415})
    assert found.verdict["ends"] == found.verdict["both"] == "higher"


def test_a_seed_whose_first_skill_hands_nothing_over_is_left_out():
    rows = pd.DataFrame(
        seam(0, after_after=90, before_after=70, after_before=80, before_before=60)
        + seam(1, after_after=0, before_after=0, after_before=0, before_before=0)
    )
    rows.loc[(rows.seed == 1) & (rows.handed_by == "before"), "handed"] = 0
    found = exchange_effects(rows).set_index("effect")
    assert (found.seeds == 1).all() and found.value["ends"] == pytest.approx(0.2)
    assert effects_of_seeds(rows)["seed"].unique().tolist() == [0]
    rows["handed"] = 0
    assert exchange_effects(rows.assign(taken=0)).empty


def test_seeds_that_all_show_the_same_say_nothing_of_others():
    """Without any spread Student's test has nothing to go by, but where all differences are 0."""
    alike = {"after_after": 90, "before_after": 70, "after_before": 90, "before_before": 70}
    rows = [row for seed in range(3) for row in seam(seed, **alike)]
    found = exchange_effects(pd.DataFrame(rows)).set_index("effect")
    assert found.value.to_dict() == pytest.approx({"ends": 0.2, "taking over": 0.0, "both": 0.2})
    assert math.isnan(found.p_value["ends"]) and found.p_value["taking over"] == 1.0
    assert found.verdict.to_dict() == {
        "ends": "no spread",
        "taking over": "no clear difference",
        "both": "no spread",
    }


def test_rows_of_two_chains_and_a_seed_without_all_cells_are_refused():
    rows = seam(0, after_after=90, before_after=70, after_before=80, before_before=60)
    two = [{**row, "system": name, "checkpoint": "last"} for name in ("tstar", "other") for row in rows]
    with pytest.raises(InvalidValueError, match="of one system, got other, tstar"):
        exchange_effects(pd.DataFrame(two))
    lacking = rows + seam(1, after_after=90, before_after=70, after_before=80)
    with pytest.raises(InvalidValueError, match="skill 1 needs 4 rows of each seed; not so: 1$"):
        exchange_effects(pd.DataFrame(lacking))


def test_the_page_has_them_as_a_table_and_as_dots(published, tmp_path):
    one = seam(3, after_after=90, before_after=70, after_before=80, before_before=60)
    other = seam(4, after_after=80, before_after=40, after_before=80, before_before=60)
    pd.DataFrame(one + other).to_csv(published / "odd.csv", index=False)
    odd = {"folder": "odd", "kind": "experiment", "exchanged": "odd.csv"}
    contents(published, [odd, {"folder": "plain", "kind": "paper"}])
    with pytest.raises(
        ValueError, match="exchanged needs pairs, whose first says which arm's skills stand in whose"
    ):
        results_page(published, THEIRS, "")
    odd["pairs"] = [["tstar", "buffer_no_gate"]]
    contents(published, [odd, {"folder": "plain", "kind": "paper"}])
    page = results_page(published, THEIRS, "")
    assert "#### Skills exchanged" in page and "odd_table_exchanged.png" in page
    assert "between the two chains of a seed: T-STAR less buffer starts, every turn kept." in page
    assert re.search(
        r"\| skill 1 to skill 2 \| 2 \| \+0\.250 \[[^|]+\] \| no clear difference \| [+-]0\.000 \[", page
    )
    rows = pd.DataFrame(one + other)
    figure = effects_figure(exchange_effects(rows), effects_of_seeds(rows), {"ends": "the first's ends"})
    (axes,) = figure.axes
    dots = [line.get_xdata().tolist() for line in axes.lines if line.get_marker() == "o"]
    assert dots[0] == pytest.approx([0.2, 0.3]) and axes.get_title() == "the first's ends"
