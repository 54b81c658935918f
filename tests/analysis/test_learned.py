"""Which skills are learned, on numbers made by hand."""

import shutil

import pandas as pd
import pytest
from published_runs import COMMIT, THEIRS, contents

from tstar_rl.analysis.learned import Learned, evaluated_skills, learned_skills
from tstar_rl.analysis.page import results_page
from tstar_rl.analysis.page.contents import read_contents

RULE = Learned(mean=0.95, lowest=0.9, seeds=3)


def skills(*success: list[float], **more) -> pd.DataFrame:
    """Rows of subtasks in order, each with the success of its seeds."""
    own = {"task": "table", "recipe": "gail_ppo", "checkpoint": "last", "mode": "deterministic", **more}
    return pd.DataFrame(
        [
            {**own, "subtask": subtask, "seed": seed, "success": value}
            for subtask, seeds in enumerate(success)
            for seed, value in enumerate(seeds)
        ]
    )


def test_a_skill_is_learned_if_its_mean_and_its_worst_seed_are_good():
    rows = skills([0.95, 0.9, 1.0], [1.0, 1.0, 0.89], [0.94, 0.95, 0.95], [1.0, 1.0])
    found = learned_skills(RULE, rows)
    assert found["answer"].tolist() == ["yes", "no", "no", "measured so far: 2 of 3 seeds"]
    assert found["mean"].tolist() == pytest.approx([0.95, 0.9633, 0.9467, 1.0], abs=1e-4)
    assert found["lowest"].tolist() == [0.9, 0.89, 0.94, 1.0]


def test_last_checkpoints_of_the_tasks_skills_count():
    kept = skills([1.0, 0.9])
    others = [
        skills([0.0], **{name: value})
        for name, value in (
            ("task", "chair"), ("recipe", "bc"), ("checkpoint", "best"), ("mode", "stochastic"),
        )
    ]  # fmt: skip
    whole = skills([0.0]).assign(subtask=-1)
    found = evaluated_skills(RULE, pd.concat([*others, whole, kept[::-1]]), "table")
    pd.testing.assert_frame_equal(found, kept)


@pytest.mark.parametrize("arms", [True, False], ids=["with arms", "skills alone"])
def test_the_page_says_which_skills_are_learned(published, arms):
    if not arms:
        shutil.rmtree(published / "odd/table")
    for seed, success in ((3, 1.0), (4, 0.9), (5, 0.95)):
        folder = published / f"odd/table/gail_ppo/seed{seed}/subtask0"
        folder.mkdir(parents=True)
        row = {"checkpoint": "last", "mode": "deterministic", "seed": seed, "env_steps": 1e6, "minutes": 1}
        row |= {
            "episodes": 200,
            "progress": success,
            "success": success,
            "success_low": 0.9,
            "success_high": 1.0,
        }
        pd.DataFrame([row]).to_csv(folder / "evaluation.csv", index=False)
        (folder / "config.yaml").write_text(f"versions: {{commit: {COMMIT}}}\n")
    odd = {"folder": "odd", "kind": "experiment"}
    plain = {"folder": "plain", "kind": "paper"}
    contents(published, [odd, plain])
    assert "skills are learned" not in results_page(published, THEIRS, "")
    assert ("#### Arms" in results_page(published, THEIRS, "")) == arms
    assert "All runs come from commit ccccccc." in results_page(published, THEIRS, "")
    contents(published, [{**odd, "learned": {"mean": 0.95, "lowest": 0.9, "seeds": 3}}, plain])
    page = results_page(published, THEIRS, "")
    assert "#### Which skills are learned\n\n| subtask | success of each seed [95%, Wilson] | mean |" in page
    assert (
        "| 0 | 3: 1.000 [0.90, 1.00]; 4: 0.900 [0.90, 1.00]; 5: 0.950 [0.90, 1.00] | 0.950 | **yes** |"
        in page
    )


def test_a_rule_with_a_field_missing_is_refused(published):
    for learned, message in (
        ({"mean": 0.95, "worst": 0.9}, "learned has no worst; it has mean, lowest, seeds"),
        ({"mean": 0.95}, "learned lacks lowest, which must be a number"),
    ):
        odd = {"folder": "odd", "kind": "experiment", "learned": learned}
        contents(published, [odd, {"folder": "plain", "kind": "paper"}])
        with pytest.raises(ValueError, match=message):
            read_contents(published)
