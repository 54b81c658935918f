"""Experiments: arms and seeds read from made-up tables, their hand-over gap, comparisons and commits."""

import math
import shutil

import numpy as np
import pandas as pd
import pytest
from arm_tables import write_arm, write_skills

from tstar_rl.analysis import (
    arm_table,
    compare_arms,
    episode_progress,
    hand_over_gaps,
    product_of_skills,
    read_experiment,
)
from tstar_rl.checks import InvalidValueError

PAIRS = [("tstar", "buffer"), ("tstar", "not_run")]


def test_episodes_are_found_again_from_the_shares():
    row = pd.Series({"episodes": 10, "progress": 0.5, "subtask_0": 0.8, "subtask_1": 0.5, "subtask_2": 0.2})
    # 2 of 10 complete none of three, 3 complete one, 3 two, 2 all: (0 + 3 + 6 + 6) / 30 = 0.5.
    expected = [0] * 2 + [1 / 3] * 3 + [2 / 3] * 3 + [1] * 2
    np.testing.assert_allclose(episode_progress(row), expected)
    short = pd.Series(
        {"episodes": 2, "progress": 0.75, "subtask_0": 1.0, "subtask_1": 0.5, "subtask_2": np.nan}
    )
    assert episode_progress(short).tolist() == [0.5, 1.0]


@pytest.mark.parametrize(
    ("change", "message"),
    [({"subtask_1": 0.9}, "must not rise along the task"), ({"progress": 0.9}, "not the mean of the shares")],
)
def test_a_table_that_contradicts_itself_is_refused(change, message):
    row = {"episodes": 10, "progress": 0.65, "subtask_0": 0.8, "subtask_1": 0.5, **change}
    with pytest.raises(ValueError, match=message):
        episode_progress(pd.Series(row))


def test_arms_are_read_with_their_seeds_and_commits(two_arms):
    experiment = read_experiment(two_arms, one_commit=True)
    rows = experiment.chosen("table")
    assert rows[["arm", "seed"]].to_numpy().tolist() == [
        ["buffer", 0],
        ["buffer", 1],
        ["tstar", 0],
        ["tstar", 1],
    ]
    assert experiment.tasks == ["table"] and list(experiment.commits()) == ["a" * 40]
    assert set(experiment.skills["arm"]) == {"skills"} and "skills" not in set(rows["arm"])
    sampled = experiment.chosen("table", mode="stochastic")
    assert (sampled["progress"] == 0).all() and len(sampled) == 4
    with pytest.raises(InvalidValueError, match="has the tasks table; got 'tabel'; did you mean table"):
        experiment.chosen("tabel")
    with pytest.raises(InvalidValueError, match="checkpoint must be one of best, last, prior; got 'lst'"):
        experiment.chosen("table", "lst")
    with pytest.raises(
        InvalidValueError, match="mode must be one of deterministic, stochastic; got 'sampled'"
    ):
        experiment.chosen("table", mode="sampled")


def test_the_table_of_arms_by_hand(two_arms):
    table = arm_table(read_experiment(two_arms).chosen("table"))
    # Two seeds: nothing is cut. T-STAR: (.95 + .85) / 2; success (.9 + .7) / 2.
    assert table.loc["tstar", ["progress", "success"]].tolist() == pytest.approx([0.9, 0.8])
    assert table.loc["buffer", ["progress", "success"]].tolist() == pytest.approx([0.675, 0.5])
    assert table.loc["tstar", ["seeds", "episodes"]].tolist() == [2, 40]
    for measure in ("progress", "success"):
        assert (table[f"{measure}_low"] < table[measure]).all() and (
            table[measure] < table[f"{measure}_high"]
        ).all()


def test_comparisons_are_paired_by_seed(two_arms):
    write_arm(two_arms, "tstar", 7, [0.0, 0.0])  # a seed that the other arm does not have
    rows = read_experiment(two_arms).chosen("table")
    with pytest.raises(InvalidValueError, match="what is compared has no arm not_run; it has buffer, tstar"):
        compare_arms(rows, PAIRS)
    with pytest.raises(
        InvalidValueError, match="what is compared has no arms at all; got buffer, not_run, tstar"
    ):
        compare_arms(rows[:0], PAIRS)
    found = compare_arms(rows, PAIRS, absent_ok=True)
    assert found[["first", "second", "seeds"]].to_numpy().tolist() == [["tstar", "buffer", 2]]
    row = found.iloc[0]
    # Differences .95 - .75 and .85 - .6: mean .225, deviation .05 / sqrt(2), t of one degree 12.706.
    assert row["difference"] == pytest.approx(0.225) and row["improvement"] == 1.0
    assert row["t_half"] == pytest.approx(12.706 * 0.05 / 2, abs=1e-3)
    assert row["low"] > 0 and row["verdict"] == "no clear difference"


def test_product_of_skills_by_hand():
    # .93, .93 x .90 = .837, x .94 = .78678, x .92 = .72384: their mean is .8194.
    assert product_of_skills([0.93, 0.90, 0.94, 0.92]) == pytest.approx(0.819405)
    assert product_of_skills([1.0, 1.0]) == 1.0


def test_the_gap_is_of_the_arms_own_skills_where_they_were_tried(two_arms):
    rows = [
        {"system": "tstar", "seed": 0, "checkpoint": "last", "subtask": k, "own_starts": own}
        for k, own in enumerate((1.0, 1.0))
    ]
    pd.DataFrame(rows).to_csv(two_arms / "table" / "hand_over.csv", index=False)
    gaps = hand_over_gaps(read_experiment(two_arms), "table").set_index(["arm", "seed"])
    # Its own skills: 1 - .95. Those before fine-tuning: (1 + .95) / 2 = .975, less .85 and .75.
    assert gaps.loc[("tstar", 0), "gap"] == pytest.approx(0.05) and gaps.loc[("tstar", 0), "fine_tuned"]
    assert gaps.loc[("tstar", 1), "gap"] == pytest.approx(0.125) and not gaps.loc[("tstar", 1), "fine_tuned"]
    assert gaps.loc[("buffer", 0), "gap"] == pytest.approx(0.225)


def test_the_best_of_chains_as_they_are_have_the_product_of_the_best_skills(two_arms):
    write_arm(two_arms, "no_finetuning", 0, [1.0, 0.5])
    for subtask in (0, 1):
        file = two_arms / "table" / "skills" / "seed0" / f"subtask{subtask}" / "evaluation.csv"
        last = pd.read_csv(file)
        pd.concat([last, last.assign(checkpoint="best", success=0.5)]).to_csv(file, index=False)
    found = {
        checkpoint: hand_over_gaps(read_experiment(two_arms), "table", checkpoint).set_index(["arm", "seed"])
        for checkpoint in ("last", "best")
    }
    assert found["last"].loc[("no_finetuning", 0), "product"] == pytest.approx(0.975)
    assert found["best"].loc[("no_finetuning", 0), "product"] == pytest.approx((0.5 + 0.25) / 2)
    assert found["best"].loc[("tstar", 0), "product"] == pytest.approx(0.975)  # it began with the last ones


def test_the_gap_of_an_arm_with_skills_of_its_own_is_of_these(two_arms):
    write_arm(two_arms, "wider", 0, [0.5, 0.5], skills="wider/skills")
    write_skills(two_arms, 0, [0.5, 0.5], "wider/skills")
    gaps = hand_over_gaps(read_experiment(two_arms), "table").set_index(["arm", "seed"])
    assert gaps.loc[("wider", 0), "product"] == pytest.approx((0.5 + 0.25) / 2)


def test_the_gap_of_a_chain_that_began_with_the_best_skills_is_of_these(two_arms):
    write_arm(two_arms, "from_best", 0, [0.5, 0.5])
    file = two_arms / "table" / "from_best" / "seed0" / "config.yaml"
    file.write_text(file.read_text() + "from_checkpoint: best\n")
    for subtask in (0, 1):
        of_skill = two_arms / "table" / "skills" / "seed0" / f"subtask{subtask}" / "evaluation.csv"
        last = pd.read_csv(of_skill)
        pd.concat([last, last.assign(checkpoint="best", success=0.9)]).to_csv(of_skill, index=False)
    gaps = hand_over_gaps(read_experiment(two_arms), "table").set_index(["arm", "seed"])
    assert gaps.loc[("from_best", 0), "product"] == pytest.approx((0.9 + 0.81) / 2)
    assert gaps.loc[("tstar", 0), "product"] == pytest.approx(0.975)


def test_without_a_try_of_the_skills_there_is_no_gap(tmp_path):
    write_arm(tmp_path, "tstar", 0, [1.0, 0.5])
    assert hand_over_gaps(read_experiment(tmp_path), "table")["gap"].isna().all()


@pytest.mark.parametrize("commit", ["a" * 40 + "-dirty", "unknown", "a" * 40 + "+" + "b" * 40])
def test_arms_whose_code_no_commit_has_are_refused(tmp_path, commit):
    for arm in ("gaussian", "tstar"):
        write_arm(tmp_path, arm, 0, [1.0, 0.5], commit=commit)
    assert len(read_experiment(tmp_path).commits()) == 1
    with pytest.raises(ValueError, match="must come from one commit"):
        read_experiment(tmp_path, one_commit=True)


@pytest.mark.parametrize("commit", ["b" * 40, None])
def test_arms_of_several_commits_are_refused(two_arms, commit):
    write_arm(two_arms, "gaussian", 0, [1.0, 0.5], commit=commit)
    assert len(read_experiment(two_arms).commits()) == 2
    named = "bbbbbbb: table/gaussian/seed0" if commit else "unknown: table/gaussian/seed0"
    with pytest.raises(ValueError, match=f"must come from one commit, got aaaaaaa: .*; {named}"):
        read_experiment(two_arms, one_commit=True)


def test_skills_of_another_commit_are_refused(two_arms):
    write_skills(two_arms, 2, [1.0], commit="b" * 40)
    with pytest.raises(
        ValueError, match="must come from one commit, got aaaaaaa: .*; bbbbbbb: table/skills/seed2"
    ):
        read_experiment(two_arms, one_commit=True)


def test_a_chain_of_which_a_skill_was_not_tried_alone_has_no_product(two_arms):
    shutil.rmtree(two_arms / "table" / "skills" / "seed1" / "subtask1")
    gaps = hand_over_gaps(read_experiment(two_arms), "table").set_index(["arm", "seed"])
    assert gaps.loc[("tstar", 0), "product"] == pytest.approx((1 + 0.95) / 2)
    assert math.isnan(gaps.loc[("tstar", 1), "product"])


def test_an_empty_folder_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no <task>/<arm>/seed<k>/evaluation.csv below"):
        read_experiment(tmp_path)
