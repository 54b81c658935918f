"""The recipe that measures a hand-over gap, on a chain whose gap and its cause are known."""

import math
import runpy
from pathlib import Path

import pandas as pd
import pytest
import torch
from hydra import compose, initialize_config_dir
from point_chain import PointChain, make_skills

from tstar_rl.config.values import CONFIGS
from tstar_rl.env import furniture_env
from tstar_rl.env.layout import PARTS, observation_size
from tstar_rl.rollouts.hand_overs import HandOver

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def measure(tmp_path, monkeypatch):
    """Runs the recipe on the point's skills; returns its two tables."""
    make_skills(tmp_path)
    monkeypatch.setattr(furniture_env, "FurnitureEnv", PointChain)

    def run(*values: str) -> tuple[pd.DataFrame, pd.DataFrame]:
        places = [f"{place}_dir={tmp_path / place}" for place in ("results", "runs")]
        with initialize_config_dir(str(CONFIGS), version_base="1.3"):
            config = compose(
                "recipe/hand_over_gap", [*places, "+env.max_steps=20", "progress_bar=false", *values]
            )
        runpy.run_path(str(ROOT / "recipes/hand_over_gap.py"))["main"].__wrapped__(config)
        folder = tmp_path / "results/table_lack"
        return pd.read_csv(folder / "hand_over_gap.csv"), pd.read_csv(folder / "seams.csv")

    return run


def test_gap_floors_cause_and_influence_of_a_chain_that_fails_where_y_is_negative(measure):
    """Each skill succeeds from its own starts; half of the ends of skill 0 have y < 0, where skill 1 fails for good."""
    gaps, seams = measure("floors=[5.0, 0.01]")
    assert gaps.floor.tolist() == [0.0, 0.01, 5.0]
    trained = gaps.iloc[0]
    assert trained[["own_0", "own_1", "own_2", "own_3"]].tolist() == [1.0] * 4
    assert trained["product"] == 1.0
    assert trained.gap == pytest.approx(1.0 - trained.progress)
    assert 0.30 < trained.gap_low < 0.375 < trained.gap_high < 0.45  # 3/4 of a half
    assert gaps.progress.nunique() == 1, "the skills do not look at their inputs: no floor changes anything"
    assert gaps.raised_inputs.tolist()[1:] == [0, 4 * 72]
    first = seams.set_index("subtask").loc[1]
    assert first.succeeded == pytest.approx(0.5, abs=0.07)
    assert first.area > 0.95
    assert (first.strongest, first.strongest_area) == ("joint 1", 1.0), "y"
    assert first.split_by == "joint 1" and abs(first.split) < 0.1, "two heaps, y < 0 and y > 0"
    assert first.succeeded_below < 0.1 and first.succeeded_above > 0.9
    assert first["fall robot"] > 0.3, "x and y are the first two numbers, the robot's"
    assert abs(first["fall leg_2 position"]) < 0.02
    assert first["off robot"] > first["own robot"] > 0, (
        "joints: where skill 0 ends is not where skill 1 begins"
    )
    assert first["off leg_2 position"] == first["own leg_2 position"] == 0
    assert first.influence_starts == 32
    assert first.within < 0.5, "a step moves y by a tenth: where it began has decided it"
    assert seams.set_index("subtask").loc[2].succeeded == 1.0


def test_a_second_run_replaces_its_own_rows_and_leaves_others(measure):
    few = ("evaluation.episodes=8", "evaluation.whole_episodes=8", "influence_starts=0", "floors=[0.02]")
    first, _ = measure(*few)
    again, seams = measure(*few)
    pd.testing.assert_frame_equal(first, again)
    assert seams.influence_starts.tolist() == [0, 0, 0]


def test_sides_of_an_input_that_is_asked_for(measure):
    few = ("evaluation.episodes=8", "evaluation.whole_episodes=8", "influence_starts=0", "floors=[]")
    _, seams = measure(*few, "split_by=joint 0")
    assert seams.split_by.tolist() == ["joint 0"] * 3
    with pytest.raises(ValueError, match="split_by must be null or an input such as joint 6.*got 'joint7'"):
        measure(*few, "split_by=joint7")


@pytest.mark.parametrize("split_by", [None, "leg turn x"])
def test_the_sign_of_a_quaternion_is_no_side(split_by):
    """The leg is turned by .2 or by 1.2 rad about x, which decides; every other one comes with the other sign."""
    turned, states = torch.arange(80) % 4 > 1, torch.zeros(80, observation_size(2))
    states[:, PARTS + 3] = 1.0
    states[:, PARTS + 10] = torch.where(turned, math.cos(0.6), math.cos(0.1))
    states[:, PARTS + 11] = torch.where(turned, math.sin(0.6), math.sin(0.1))
    states[1::2, PARTS + 10 : PARTS + 14] *= -1
    seam_row = runpy.run_path(str(ROOT / "recipes/hand_over_gap.py"))["_seam_row"]
    row = seam_row(HandOver(1, states, turned), ("top", "leg"), None, split_by)
    assert row["strongest_area"] in (0.0, 1.0) and row["strongest"].startswith("leg turn")
    by_w = row["split_by"] == "leg turn w"  # more of w is less of a turn
    assert (row["succeeded_below"], row["succeeded_above"]) == ((1.0, 0.0) if by_w else (0.0, 1.0))
    nobody = seam_row(HandOver(2, states[:0], turned[:0]), ("top", "leg"), None, split_by)
    assert math.isnan(nobody["split"])


def test_rows_of_a_chain_are_replaced_with_those_of_all_its_floors(measure):
    """Its skills may have been trained anew between the two calls."""
    few = ("evaluation.episodes=8", "evaluation.whole_episodes=8", "influence_starts=0")
    measure("floors=[0.01]", *few)
    gaps, seams = measure("floors=[]", *few)
    assert gaps.floor.tolist() == [0.0] and seams.subtask.tolist() == [1, 2, 3]
