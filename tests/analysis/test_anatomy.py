"""The anatomy of seams, on tables of two seeds made by hand."""

import math

import pandas as pd
import pytest

from tstar_rl.analysis.anatomy import anatomy_changes, deciding_inputs, seam_anatomy
from tstar_rl.analysis.figures.anatomy import anatomy_figure

SYSTEMS = ["no_finetuning", "tstar"]


@pytest.fixture
def tables() -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """The leg's turn decides. T-STAR leaves the leg straighter by 1 and by 2 degrees, and keeps one turn of two.

    A second seam has too few failures to say what decides.
    """
    seams, gaps, metrics = [], [], []
    for seed in (0, 1):
        for system, off, success in zip(SYSTEMS, (3.0, 2.0 - seed), (0.5, 0.75), strict=True):
            row = {"system": system, "seed": seed, "checkpoint": "last", "subtask": 1, "succeeded": success}
            row |= {"fall robot": 0.0, "fall leg orientation": 0.2 + seed / 10}
            row |= {
                "off robot": 5.0,
                "own robot": 5.0,
                "off leg orientation": off,
                "own leg orientation": 0.5,
            }
            seams.append(row)
            seams.append({**row, "subtask": 2, "fall robot": math.nan, "fall leg orientation": math.nan})
            gaps.append(
                {"system": system, "seed": seed, "floor": 0.0, "own_0": 1.0 - seed / 10, "own_1": 0.5}
            )
            gaps.append({**gaps[-1], "floor": 0.05, "own_0": 0.0})
        for skill, accepted in ((0, 1), (0, 0), (1, 1)):
            turn = {"recipe": "tstar", "seed": seed, "subtask": -1, "skill": skill, "accepted": accepted}
            metrics += [turn, {**turn, "accepted": math.nan}]  # a rollout within a turn
    return pd.DataFrame(seams), pd.DataFrame(gaps), pd.DataFrame(metrics)


def test_a_seam_by_hand(tables):
    found = seam_anatomy(*tables, SYSTEMS)
    assert set(found["subtask"]) == {1} and set(found["by"]) == {"leg orientation"}
    tuned = found[found["system"] == "tstar"].set_index("seed")
    assert tuned["off"].tolist() == [2.0, 1.0] and set(found["saw"]) == {0.5}
    assert tuned["own_success"].tolist() == [1.0, 0.9] and set(tuned["kept"]) == {0.5}
    assert found[found["system"] == "no_finetuning"]["kept"].isna().all()


def test_changes_by_hand(tables):
    found = anatomy_changes(seam_anatomy(*tables, SYSTEMS), "tstar", "no_finetuning").set_index("what")
    assert list(found.index) == ["off", "next_success", "own_success"], "nothing is kept without turns"
    assert found.at["off", "difference"] == -1.5
    assert found.at["off", "t_half"] == pytest.approx(12.706 * 0.5, abs=1e-3)  # t with one degree of freedom
    assert found.at["next_success", "difference"] == 0.25 and set(found["seeds"]) == {2}


def test_chains_that_were_not_measured_are_named(tables):
    with pytest.raises(ValueError, match="no seams of scar_like: there are those of no_finetuning, tstar"):
        seam_anatomy(*tables, ["no_finetuning", "scar_like"])
    seams, *others = tables
    with pytest.raises(ValueError, match="at no seam of tstar there are enough successes"):
        seam_anatomy(seams[seams["subtask"] == 2], *others, ["tstar"])


def test_the_figure_has_a_dot_for_each_seed(tables):
    found = seam_anatomy(*tables, SYSTEMS)
    figure = anatomy_figure(deciding_inputs(tables[0], SYSTEMS[0]), found, {name: name for name in SYSTEMS})
    decides, off, succeeds, own, kept = figure.axes
    assert [label.get_text() for label in decides.get_yticklabels()] == ["leg orientation", "robot"]
    assert (
        off.get_xlabel() == "leg orientation: degrees off own starts" and off.lines[-1].get_xdata()[0] == 0.5
    )
    assert [len(dots.get_offsets()) for dots in off.collections] == [2, 2]
    assert len(succeeds.collections) == len(own.collections) == 2 and len(kept.collections) == 1
    without = anatomy_figure(
        deciding_inputs(tables[0], SYSTEMS[0]), found.assign(kept=math.nan), {name: name for name in SYSTEMS}
    )
    assert [axes.get_title() for axes in without.axes] == [
        axes.get_title() for axes in figure.axes[:-1]
    ]  # no gate, no panel
    assert "hand_over_gap" in anatomy_figure(found, found[:0], {}).axes[0].texts[0].get_text()


def test_the_recipe_writes_both(tables, call, say, tmp_path):
    place = tmp_path / "results" / "table_lack"
    assert "no results/table_lack/seams.csv: recipes/hand_over_gap.py writes it" in say("anatomy")
    place.mkdir(parents=True)
    for name, table in zip(("seams", "hand_over_gap"), tables, strict=False):
        table.assign(checkpoint="last").to_csv(place / f"{name}.csv", index=False)
    said = say("anatomy", "systems=[no_finetuning, tstar]", "names=[T-STAR]")
    assert "names must be null or one for each of systems ['no_finetuning', 'tstar'], got ['T-STAR']" in said
    call("anatomy", "systems=[no_finetuning, tstar]", "names=[as they were, T-STAR]")
    assert len(pd.read_csv(place / "anatomy.csv")) == 4 and (place / "anatomy.png").is_file()
