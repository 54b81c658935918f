"""Where a skill ends over training: the plane, the spread, and how a chain's skills hand over."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tstar_rl.analysis import hand_over_matrix, read_calibration, reliability_figure, terminal_state_plane
from tstar_rl.analysis.terminal_states import (
    add_plane,
    principal_plane,
    read_terminal_states,
    spread,
)
from tstar_rl.checks import MissingFileError

POSE = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]


def write(folder, system: str, rows: list[tuple[int, float]], task: str = "table") -> None:
    """A log of one part that moves along x: (environment steps, x) each."""
    place = folder / task / system / "seed0"
    place.mkdir(parents=True)
    poses = [[x, *POSE[1:]] for _, x in rows]
    table = pd.DataFrame(poses, columns=[f"pose_{i}" for i in range(7)])
    table.insert(0, "env_steps", [steps for steps, _ in rows])
    table.insert(1, "skill", 2)
    table.to_csv(place / "terminal_states.csv", index=False)


def test_the_plane_of_points_on_two_axes():
    # Twice as far along the first axis: variances 4 and 1, shares 0.8 and 0.2.
    points = np.array([[2.0, 0, 0], [-2.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]])
    plane, shares = principal_plane(points)
    np.testing.assert_allclose(plane, points[:, :2], atol=1e-12)
    assert shares.tolist() == pytest.approx([0.8, 0.2])


def test_spread_in_each_third_by_hand(tmp_path):
    # Variance of (-1, 1) is 2, of (-2, 2) 8, of one state nothing; two rollouts to a third where they do not divide.
    rows = [(10, -1.0), (20, 1.0), (30, -2.0), (30, 2.0), (40, 5.0)]
    write(tmp_path, "tstar", rows)
    write(tmp_path, "policy_sequencing", [(10, 0.0), (20, 0.0), (20, 0.0)])
    table = read_terminal_states(tmp_path, "table", ["tstar", "policy_sequencing"])
    assert table[table.system == "tstar"].progress.tolist() == pytest.approx([0, 1 / 3, 2 / 3, 2 / 3, 1])
    table, shares = add_plane(table)
    numbers = spread(table).set_index(["system", "third"])
    assert numbers.loc["tstar"].states.tolist() == [2, 2, 1]
    assert numbers.loc["tstar"].spread.tolist()[:2] == pytest.approx([2.0, 8.0])
    assert numbers.loc["tstar"].spread_position.tolist()[:2] == pytest.approx([2.0, 8.0])
    assert pd.isna(numbers.loc[("tstar", 3), "spread"])
    assert numbers.loc["policy_sequencing"].states.tolist() == [1, 2, 0]
    panels = terminal_state_plane(table, shares).axes
    assert [axes.get_title() for axes in panels[:2]] == ["tstar", "policy sequencing"]
    drawn = [np.asarray(axes.collections[0].get_offsets()) for axes in panels[:2]]
    np.testing.assert_allclose(np.concatenate(drawn), table[["x", "y"]])


def test_systems_without_a_log_are_named(tmp_path):
    write(tmp_path, "tstar", [(0, 0.0)])
    with pytest.raises(
        MissingFileError,
        match="no terminal_states.csv of none, other below .*table: .* a chain.logged_skill that the chain has",
    ):
        read_terminal_states(tmp_path, "table", ["none", "tstar", "other"])


def test_too_few_states_are_refused():
    with pytest.raises(ValueError, match="at least 3 of them, got 1"):
        add_plane(pd.DataFrame([POSE], columns=[f"pose_{i}" for i in range(7)]))


def test_the_hand_over_matrix_is_drawn_with_what_is_missing():
    rows = [{"system": "tstar", "subtask": k, "own_starts": 1.0, "handed_over": 0.5} for k in range(2)]
    rows[0]["handed_over"] = float("nan")
    own, handed = hand_over_matrix(pd.DataFrame(rows)).axes
    assert [text.get_text() for text in own.texts] == ["1.00", "1.00"]
    assert [text.get_text() for text in handed.texts] == ["", "0.50"]


def test_what_signals_said_is_read_and_drawn_against_what_happened(tmp_path):
    folder = tmp_path / "table" / "feasibility" / "seed4"
    folder.mkdir(parents=True)
    rows = {"env_steps": [8, 8, 9], "skill": [0, 0, 1], "signal": ["f"] * 3}
    rows |= {"score": [0.2, 0.9, 0.5], "outcome": [0.5, 1.0, 0.25], "states": [10, 40, 20]}
    pd.DataFrame(rows).to_csv(folder / "calibration.csv", index=False)
    table = read_calibration(tmp_path)
    assert table.recipe.tolist() == ["feasibility"] * 3 and table.seed.tolist() == [4] * 3
    (axes,) = reliability_figure(table).axes
    first, second = axes.collections
    np.testing.assert_allclose(first.get_offsets(), [[0.2, 0.5], [0.9, 1.0]])
    np.testing.assert_allclose(second.get_offsets(), [[0.5, 0.25]])
    np.testing.assert_allclose(first.get_sizes(), [30, 120])  # areas go with the states
    assert axes.get_title() == "f" and [text.get_text() for text in axes.get_legend().get_texts()] == [
        "after skill 1",
        "after skill 2",
    ]
    assert (
        "calibration.csv"
        in reliability_figure(read_calibration(tmp_path / "none")).axes[0].texts[0].get_text()
    )


PUBLISHED = Path(__file__).resolve().parents[2] / "results" / "published"


@pytest.mark.parametrize(
    "path", sorted(PUBLISHED.glob("*/*/terminal_states_spread.csv")), ids=lambda p: p.parts[-3]
)
def test_the_published_spread_comes_out_of_the_published_states(path):
    published, task = pd.read_csv(path), path.parent.name
    systems = list(dict.fromkeys(published["system"]))
    again = spread(add_plane(read_terminal_states(path.parents[1], task, systems))[0])
    pd.testing.assert_frame_equal(again, published, check_exact=False, atol=1e-6, rtol=1e-6)


def test_the_recipe_draws_what_chains_logged_or_says_that_none_did(tmp_path, call, say):
    values = (f"results_dir={tmp_path}", "task=table_lack", "systems=[tstar,policy_sequencing]")
    assert "no terminal_states.csv of tstar, policy_sequencing below" in say("terminal_states", *values)
    for system in ("tstar", "policy_sequencing"):
        write(tmp_path, system, [(10, -1.0), (20, 1.0), (30, -2.0), (30, 2.0), (40, 5.0)], task="table_lack")
    call("terminal_states", *values)
    place = tmp_path / "table_lack"
    numbers = pd.read_csv(place / "terminal_states_spread.csv")
    assert numbers.groupby("system").spread.first().to_dict() == {"tstar": 2.0, "policy_sequencing": 2.0}
    assert (place / "terminal_states.png").stat().st_size > 1000
