"""The order and the values of the steps of the whole pipeline; the steps themselves are not run."""

import inspect
import runpy
from pathlib import Path

import pandas as pd
import pytest
from hydra import compose, initialize_config_dir

from tstar_rl.config.values import CONFIGS

RECIPE = Path(__file__).resolve().parents[2] / "recipes/assemble.py"


@pytest.fixture(scope="module")
def steps(tmp_path_factory) -> list[tuple[str, ...]]:
    """Those that the recipe runs in an empty folder; T-STAR leaves a table in which it was paid .5 a success."""
    tmp_path, run = tmp_path_factory.mktemp("assemble"), []
    given = [f"{place}_dir={tmp_path / place}" for place in ("results", "runs", "demonstrations")]
    paid = {"skill": [0], "episodes": [10], "success_rate": [0.4], "tsr_on_success": [0.5]}

    def note(step: tuple[str, ...], shared: list[str], line: int = 0) -> None:
        run.append(step)
        assert shared == given
        if step[0] == "tstar":
            folder = tmp_path / "results/table_lack/tstar" / step[1].replace("=", "")
            folder.mkdir(parents=True)
            pd.DataFrame(paid).to_csv(folder / "metrics.csv", index=False)
            ended = tmp_path / "runs" / folder.relative_to(tmp_path / "results")
            ended.mkdir(parents=True)
            (ended / "finished.json").write_text("{}")

    main = inspect.unwrap(runpy.run_path(str(RECIPE))["main"])
    main.__globals__.update(
        launcher=lambda config: note, passed_on=lambda own: given, chosen_scale=lambda: "laptop"
    )
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        main(compose("recipe/assemble", [*given, "seeds=[3,4]", "processes=1"]))
    return run


def test_skills_come_before_chains_and_curves_last(steps):
    names = [step[0] for step in steps]
    assert names[:16] == ["make_demonstrations", "gail_ppo"] * 8  # of two seeds, four skills each
    assert sorted(names[16:-1]) == sorted(
        2 * (["tstar"] + ["policy_sequencing"] * 2 + ["evaluate"] * 4) + ["evaluate"] * 8
    )
    assert steps[-1] == ("plot",)


def test_the_constant_bonus_is_what_t_star_was_paid_in_the_same_seed(steps):
    for seed in (3, 4):
        bonus = (
            "policy_sequencing",
            "system=policy_sequencing_bonus",
            f"seed={seed}",
            "terminal_reward={score: terminal, baseline: none}",  # it reads none of T-STAR's
            "bonus=0.5",
        )
        assert steps.index(("tstar", f"seed={seed}")) < steps.index(bonus)
        evaluated = [step[1] for step in steps if step[0] == "evaluate" and f"seed={seed}" == step[-1]]
        names = ("tstar", "policy_sequencing_bonus", "policy_sequencing", "no_finetuning")
        assert evaluated == [f"system={name}" for name in names]
