"""What each aid of training is worth, on numbers made by hand."""

import math

import pandas as pd
import pytest
from published_runs import COMMIT, THEIRS, contents

from tstar_rl.analysis.aids import Aids, worth_of_aids
from tstar_rl.analysis.page import draw_page, results_page
from tstar_rl.analysis.page.contents import read_contents
from tstar_rl.analysis.tables import skills_of_arms

RULE = Aids(all_aids="all_aids", succeeds=0.5, fails=0.1, seeds=3)


def skills(arms: dict[str, list[float]], **more) -> pd.DataFrame:
    """Rows of one skill of each arm, with the success of its seeds."""
    own = {"task": "table", "subtask": 3, "checkpoint": "last", "mode": "deterministic", **more}
    return pd.DataFrame(
        [
            {**own, "recipe": arm, "seed": seed, "success": value}
            for arm, seeds in arms.items()
            for seed, value in enumerate(seeds)
        ]
    )


def test_an_aid_is_needed_if_every_seed_fails_without_it_and_none_with_all():
    arms = {
        "all_aids": [0.9, 0.8, 0.7],
        "needed": [0.0, 0.09, 0.05],
        "at_the_edge": [0.0, 0.1, 0.05],
        "worth": [0.5, 0.4, 0.25],
        "open": [0.9, 0.4, 0.6],
        "few": [0.0, 0.0],
    }
    found = worth_of_aids(RULE, skills(arms)).loc[3]
    assert found["answer"].to_dict() == {
        "needed": "needed",
        "at_the_edge": "worth something",
        "worth": "worth something",
        "open": "not decided",
        "few": "measured so far: 2 of 3 seeds",
    }
    # Differences -.4, -.4 and -.45: 4.303 * .02887 / sqrt 3; and 0, -.4 and -.1: 4.303 * .20817 / sqrt 3.
    assert found.loc["worth", ["difference", "half"]].tolist() == pytest.approx([-0.41667, 0.07172], abs=1e-4)
    assert found.loc["open", ["difference", "half"]].tolist() == pytest.approx([-0.16667, 0.51713], abs=1e-4)


def test_nothing_is_needed_where_training_with_all_aids_fails_too():
    found = worth_of_aids(RULE, skills({"all_aids": [0.9, 0.5, 0.8], "other": [0.0, 0.0, 0.05]})).loc[3]
    assert found["answer"].tolist() == ["worth something"]
    assert found.loc["other", "difference"] == pytest.approx(-0.71667, abs=1e-4)


def test_every_seed_with_all_aids_must_succeed_also_one_that_the_other_arm_lacks():
    found = worth_of_aids(RULE, skills({"all_aids": [0.9, 0.8, 0.7, 0.4], "other": [0.0, 0.09, 0.05]})).loc[3]
    assert found["answer"].tolist() == ["worth something"] and found["seeds"].tolist() == [3]


def test_seeds_that_all_lose_alike_say_nothing_but_by_the_first_rule():
    found = worth_of_aids(RULE, skills({"all_aids": [0.9] * 3, "a": [0.05] * 3, "b": [0.4] * 3})).loc[3]
    assert found["answer"].to_dict() == {"a": "needed", "b": "not decided"} and math.isnan(
        found.loc["b", "half"]
    )


def test_without_the_arm_that_has_all_there_is_no_answer():
    assert worth_of_aids(RULE, skills({"other": [0.5]})).empty


def test_last_checkpoints_of_the_tasks_skills_count():
    kept = skills({"all_aids": [1.0, 0.9], "other": [0.5]})
    others = [skills({"all_aids": [0.0]}, **{name: value}) for name, value in (
        ("task", "chair"), ("checkpoint", "best"), ("mode", "stochastic"), ("subtask", -1),
    )]  # fmt: skip
    pd.testing.assert_frame_equal(skills_of_arms(pd.concat([*others, kept[::-1]]), "table"), kept)


@pytest.fixture
def trained(tmp_path):
    """Two arms of three seeds, and a declared rule."""
    for arm, seeds in {"all_aids": [0.9, 0.8, 0.7], "alone": [0.0, 0.05, 0.0]}.items():
        for seed, success in enumerate(seeds):
            folder = tmp_path / f"aids/table/{arm}/seed{seed}/subtask3"
            folder.mkdir(parents=True)
            row = {
                "checkpoint": "last",
                "mode": "deterministic",
                "seed": seed,
                "env_steps": 1e6,
                "minutes": 1,
            }
            row |= {"episodes": 200, "progress": success, "success": success}
            row |= {"success_low": success - 0.02, "success_high": success + 0.08}
            rows = [row, {**row, "mode": "stochastic", "success": success + 0.1}]
            pd.DataFrame(rows).to_csv(folder / "evaluation.csv", index=False)
            log = {
                "env_steps": [10, 20],
                "success_rate": [0.0, success],
                "phase": [1, 4],
                "episode_length": 9,
            }
            pd.DataFrame(log).to_csv(folder / "metrics.csv", index=False)
            (folder / "config.yaml").write_text(f"versions: {{commit: {COMMIT}}}\n")
    (tmp_path / "aids" / "README.md").write_text("# Aids\n\nOne is taken away.\n")
    rule = {"all_aids": "all_aids", "succeeds": 0.5, "fails": 0.1, "seeds": 3}
    entry = {"folder": "aids", "kind": "experiment", "aids": rule, "arms": {"all_aids": "with all"}}
    contents(tmp_path, [entry])
    return tmp_path


def test_the_page_says_what_each_aid_is_worth(trained):
    page = results_page(trained, THEIRS, "")
    assert (
        "#### What each aid is worth\n\n| subtask | training | success of each seed [95%, Wilson] |" in page
    )
    assert "All runs come from commit ccccccc." in page
    seeds = "0: 0.900 [0.88, 0.98]; 1: 0.800 [0.78, 0.88]; 2: 0.700 [0.68, 0.78]"
    assert f"| 3 | with all | {seeds} | 0.900 +- 0.100 | - | - |" in page
    # Differences -.9, -.75 and -.7: 4.303 * .10408 / sqrt 3.
    assert "| 0.117 +- 0.029 | -0.783 [-1.042, -0.525] | **needed** |" in page
    assert page.index("| 3 | with all |") < page.index("| 3 | alone |")


def test_the_curves_of_each_arm_are_drawn(trained, tmp_path_factory):
    found = draw_page(trained, THEIRS, tmp_path_factory.mktemp("figures"))
    assert [path.name for path in found] == ["aids_table_skills.png"]
    assert "figures/aids_table_skills.png" in results_page(trained, THEIRS, "")


def test_a_rule_with_an_unknown_field_is_refused(trained):
    contents(trained, [{"folder": "aids", "kind": "experiment", "aids": {"reference": "all_aids"}}])
    with pytest.raises(ValueError, match="aids has no reference; it has all_aids, succeeds, fails, seeds"):
        read_contents(trained)
