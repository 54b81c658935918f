"""A declared experiment: which seeds its tasks and arms have, and what of them is published."""

import pytest
from small_experiment import SMALL

from tstar_rl.experiments.values import parse_experiment
from tstar_rl.runs.run_folder import Place


def test_arms_that_are_published_can_be_left_out(tmp_path):
    experiment = parse_experiment(SMALL)
    for arm, file in (("tstar", "evaluation.csv"), ("paid", "metrics.csv")):
        folder = tmp_path / f"table_lack/{arm}/seed8"
        folder.mkdir(parents=True)
        (folder / file).touch()
    assert experiment.unpublished(tmp_path, "table_lack", 8) == ["no_finetuning", "gaussian", "paid"]
    assert "tstar" in experiment.unpublished(tmp_path, "table_lack", 7)
    assert experiment.steps_by_commit(1, 8, []) == []


def test_an_arm_may_have_fewer_seeds():
    experiment = parse_experiment(SMALL)
    assert [arm.name for arm in experiment.arms_of(7)] == ["no_finetuning", "tstar", "paid"]
    assert "gaussian" in [arm.name for arm in experiment.arms_of(8)]
    shared = experiment.shared("table_lack", 7)
    assert "seed=7" in shared and "results_dir=results/small" in shared


def test_a_task_may_have_more_seeds():
    more = {"tasks": ["table_lack", "chair_ingolf"], "seeds_by_task": {"chair_ingolf": [7, 8, 9]}}
    experiment = parse_experiment({**SMALL, **more})
    both = [(task, seed) for seed in (7, 8) for task in more["tasks"]]
    assert experiment.every_seed == (7, 8, 9) and experiment.lanes() == [*both, ("chair_ingolf", 9)]
    assert experiment.lanes([8, 9], ["chair_ingolf"]) == [("chair_ingolf", 8), ("chair_ingolf", 9)]
    # Arms without seeds of their own have every seed of the task; gaussian has seed 8 alone.
    assert [arm.name for arm in experiment.arms_of(9)] == ["no_finetuning", "tstar", "paid"]
    assert experiment.lanes([1], ["table_lack"]) == [("table_lack", 1)]  # no seed of the experiment: it tunes
    assert [arm.name for arm in experiment.arms_of(1)] == ["no_finetuning", "tstar", "paid"]
    with pytest.raises(ValueError, match="experiment small has none of seeds 9 on table_lack"):
        experiment.lanes([9], ["table_lack"])


def test_runs_that_are_declared_are_its_arms_and_their_skills():
    wide = {"name": "no_finetuning_wide", "recipe": "no_finetuning", "skill_overrides": ["env.arm_noise=0.8"]}
    experiment = parse_experiment({**SMALL, "arms": [*SMALL["arms"], wide]})
    for system, seed, subtask in (
        ("tstar", 7, None),
        ("gail_ppo", 8, 0),
        ("no_finetuning_wide/gail_ppo", 7, 3),
        ("gaussian", 8, None),
    ):
        assert experiment.declares(Place("table_lack", system, seed, subtask))
    for task, system, seed in (
        ("table_lack", "tstar", 1),  # for tuning
        ("table_lack", "withdrawn", 7),
        ("table_lack", "gaussian", 7),  # which has seed 8 alone
        ("chair_ingolf", "tstar", 7),
    ):
        assert not experiment.declares(Place(task, system, seed, None))


def test_a_task_may_have_other_seeds_than_the_rest():
    experiment = parse_experiment({**SMALL, "seeds_by_task": {"table_lack": [8]}})
    assert experiment.lanes() == [("table_lack", 8)] and experiment.every_seed == (8,)
