"""Experiments: arms and seeds read from made-up tables, their hand-over gap, comparisons, figures and commits."""

import math
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from tstar_rl.analysis import (
    arm_table,
    arms_figure,
    compare_arms,
    differences_figure,
    episode_progress,
    hand_over_gaps,
    product_of_skills,
    read_experiment,
    save_figure,
)
from tstar_rl.analysis.figures.panels import arm_dots, arm_line

PAIRS = [("tstar", "buffer"), ("tstar", "not_run")]


def write(
    root: Path,
    arm: str,
    seed: int,
    shares: list[float],
    commit: str | None = "a" * 40,
    skills="skills",
    **more,
) -> None:
    """A run of 20 episodes, of which `shares` completed each subtask; sampled actions complete nothing."""
    folder = root / "table" / arm / f"seed{seed}"
    folder.mkdir(parents=True)
    rows = []
    for checkpoint in ("last", "best"):
        for mode, factor in (("deterministic", 1), ("stochastic", 0)):
            done = [factor * share for share in shares]
            row = {"checkpoint": checkpoint, "mode": mode, "episodes": 20, "progress": np.mean(done)}
            row |= {"success": done[-1], "success_low": 0.0, "success_high": 1.0}
            rows.append(
                row | {f"subtask_{k}": share for k, share in enumerate(done)} | {"seed": seed, **more}
            )
    pd.DataFrame(rows).assign(env_steps=1e6, minutes=2).to_csv(folder / "evaluation.csv", index=False)
    if commit:
        (folder / "config.yaml").write_text(
            yaml.safe_dump({"skills": skills, "versions": {"commit": commit}})
        )


def write_skills(
    root: Path, seed: int, own: list[float], system: str = "skills", commit: str = "a" * 40
) -> None:
    for subtask, success in enumerate(own):
        folder = root / "table" / system / f"seed{seed}" / f"subtask{subtask}"
        folder.mkdir(parents=True)
        row = {
            "checkpoint": "last",
            "mode": "deterministic",
            "success": success,
            "seed": seed,
            "episodes": 20,
        }
        pd.DataFrame([row]).to_csv(folder / "evaluation.csv", index=False)
        (folder / "config.yaml").write_text(yaml.safe_dump({"versions": {"commit": commit}}))


@pytest.fixture
def root(tmp_path) -> Path:
    """Two arms of two seeds."""
    for seed, (one, other) in enumerate((([1.0, 0.9], [0.9, 0.6]), ([1.0, 0.7], [0.8, 0.4]))):
        write(tmp_path, "tstar", seed, one)
        write(tmp_path, "buffer", seed, other)
        write_skills(tmp_path, seed, [1.0, 0.95])
    return tmp_path


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


def test_arms_are_read_with_their_seeds_and_commits(root):
    experiment = read_experiment(root, one_commit=True)
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


def test_the_table_of_arms_by_hand(root):
    table = arm_table(read_experiment(root).chosen("table"))
    # Two seeds: nothing is cut. T-STAR: (.95 + .85) / 2; success (.9 + .7) / 2.
    assert table.loc["tstar", ["progress", "success"]].tolist() == pytest.approx([0.9, 0.8])
    assert table.loc["buffer", ["progress", "success"]].tolist() == pytest.approx([0.675, 0.5])
    assert table.loc["tstar", ["seeds", "episodes"]].tolist() == [2, 40]
    for measure in ("progress", "success"):
        assert (table[f"{measure}_low"] < table[measure]).all() and (
            table[measure] < table[f"{measure}_high"]
        ).all()


def test_comparisons_are_paired_by_seed(root):
    write(root, "tstar", 7, [0.0, 0.0])  # a seed that the other arm does not have
    found = compare_arms(read_experiment(root).chosen("table"), PAIRS)
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


def test_the_gap_is_of_the_arms_own_skills_where_they_were_tried(root):
    rows = [
        {"system": "tstar", "seed": 0, "checkpoint": "last", "subtask": k, "own_starts": own}
        for k, own in enumerate((1.0, 1.0))
    ]
    pd.DataFrame(rows).to_csv(root / "table" / "hand_over.csv", index=False)
    gaps = hand_over_gaps(read_experiment(root), "table").set_index(["arm", "seed"])
    # Its own skills: 1 - .95. Those before fine-tuning: (1 + .95) / 2 = .975, less .85 and .75.
    assert gaps.loc[("tstar", 0), "gap"] == pytest.approx(0.05) and gaps.loc[("tstar", 0), "fine_tuned"]
    assert gaps.loc[("tstar", 1), "gap"] == pytest.approx(0.125) and not gaps.loc[("tstar", 1), "fine_tuned"]
    assert gaps.loc[("buffer", 0), "gap"] == pytest.approx(0.225)


def test_the_best_of_chains_as_they_are_have_the_product_of_the_best_skills(root):
    write(root, "no_finetuning", 0, [1.0, 0.5])
    for subtask in (0, 1):
        file = root / "table" / "skills" / "seed0" / f"subtask{subtask}" / "evaluation.csv"
        last = pd.read_csv(file)
        pd.concat([last, last.assign(checkpoint="best", success=0.5)]).to_csv(file, index=False)
    found = {
        checkpoint: hand_over_gaps(read_experiment(root), "table", checkpoint).set_index(["arm", "seed"])
        for checkpoint in ("last", "best")
    }
    assert found["last"].loc[("no_finetuning", 0), "product"] == pytest.approx(0.975)
    assert found["best"].loc[("no_finetuning", 0), "product"] == pytest.approx((0.5 + 0.25) / 2)
    assert found["best"].loc[("tstar", 0), "product"] == pytest.approx(0.975)  # it began with the last ones


def test_the_gap_of_an_arm_with_skills_of_its_own_is_of_these(root):
    write(root, "wider", 0, [0.5, 0.5], skills="wider/skills")
    write_skills(root, 0, [0.5, 0.5], "wider/skills")
    gaps = hand_over_gaps(read_experiment(root), "table").set_index(["arm", "seed"])
    assert gaps.loc[("wider", 0), "product"] == pytest.approx((0.5 + 0.25) / 2)


def test_without_a_try_of_the_skills_there_is_no_gap(tmp_path):
    write(tmp_path, "tstar", 0, [1.0, 0.5])
    assert hand_over_gaps(read_experiment(tmp_path), "table")["gap"].isna().all()


@pytest.mark.parametrize("commit", ["a" * 40 + "-dirty", "unknown", "a" * 40 + "+" + "b" * 40])
def test_arms_whose_code_no_commit_has_are_refused(tmp_path, commit):
    for arm in ("gaussian", "tstar"):
        write(tmp_path, arm, 0, [1.0, 0.5], commit=commit)
    assert len(read_experiment(tmp_path).commits()) == 1
    with pytest.raises(ValueError, match="must come from one commit"):
        read_experiment(tmp_path, one_commit=True)


@pytest.mark.parametrize("commit", ["b" * 40, None])
def test_arms_of_several_commits_are_refused(root, commit):
    write(root, "gaussian", 0, [1.0, 0.5], commit=commit)
    assert len(read_experiment(root).commits()) == 2
    named = "bbbbbbb: table/gaussian/seed0" if commit else "unknown: table/gaussian/seed0"
    with pytest.raises(ValueError, match=f"must come from one commit, got aaaaaaa: .*; {named}"):
        read_experiment(root, one_commit=True)


def test_skills_of_another_commit_are_refused(root):
    write_skills(root, 2, [1.0], commit="b" * 40)
    with pytest.raises(
        ValueError, match="must come from one commit, got aaaaaaa: .*; bbbbbbb: table/skills/seed2"
    ):
        read_experiment(root, one_commit=True)


def test_a_chain_of_which_a_skill_was_not_tried_alone_has_no_product(root):
    shutil.rmtree(root / "table" / "skills" / "seed1" / "subtask1")
    gaps = hand_over_gaps(read_experiment(root), "table").set_index(["arm", "seed"])
    assert gaps.loc[("tstar", 0), "product"] == pytest.approx((1 + 0.95) / 2)
    assert math.isnan(gaps.loc[("tstar", 1), "product"])


def test_an_empty_folder_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no <task>/<arm>/seed<k>/evaluation.csv below"):
        read_experiment(tmp_path)


def test_every_seed_is_a_dot(root):
    rows = read_experiment(root).chosen("table")
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


def test_a_difference_has_a_dot_for_every_seed(root):
    rows = read_experiment(root).chosen("table")
    (axes,) = differences_figure(rows, PAIRS).axes
    (dots,) = [line.get_xdata() for line in axes.lines if line.get_marker() == "o"]
    np.testing.assert_allclose(dots, [0.2, 0.25])
    half = 12.706 * 0.05 / 2  # Student's, as above; the bootstrap's interval lies within it
    ends = [bar.get_segments()[0][:, 0] for bar in axes.collections]
    np.testing.assert_allclose(ends[0], [0.225 - half, 0.225 + half], atol=1e-3)
    assert ends[0][0] < ends[1][0] < 0.225 < ends[1][1] < ends[0][1]


def test_a_figure_is_the_same_file_again(root, tmp_path):
    rows = read_experiment(root).chosen("table")
    files = [save_figure(arms_figure(rows), tmp_path / f"{name}.png") for name in "ab"]
    assert files[0].read_bytes() == files[1].read_bytes()
