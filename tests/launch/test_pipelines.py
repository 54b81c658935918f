"""Recipes that start others leave out what is done."""

import pytest
from finished_steps import SUBTASKS, composed, finish, places
from recipe_runs import load_recipe

from tstar_rl.launch import bonus, overrides, steps
from tstar_rl.launch.overrides import passed_on


def test_a_recipe_passes_on_what_is_not_its_own(monkeypatch):
    given = [
        "scale=quick",
        "seeds=[0,1]",
        "++seeds=[2]",
        "+bench.steps=3",
        "~minutes",
        "seed=1",
        "env.max_steps=4",
    ]
    hydra = type("Hydra", (), {"overrides": type("Overrides", (), {"task": given})})
    monkeypatch.setattr(overrides.HydraConfig, "get", lambda: hydra)
    assert passed_on(("seeds", "bench", "minutes")) == ["scale=quick", "seed=1", "env.max_steps=4"]


@pytest.fixture
def pipeline(call, monkeypatch, tmp_path):
    """Calls a recipe that starts recipes; returns the steps that it runs, each of which leaves its files behind."""
    monkeypatch.setattr(steps, "step_config", composed)

    def run(name: str, *values: str) -> list[tuple[str, ...]]:
        taken, module = [], load_recipe(name)

        def record(step, shared=(), line=0):
            taken.append(step)
            if step[0] != "plot":
                finish(step, shared, at=len(taken))

        monkeypatch.setattr(module, "launcher", lambda config: record)
        for place in (bonus, module):
            monkeypatch.setattr(place, "mean_bonus", lambda metrics: 0.25, raising=False)
        call(name, *places(tmp_path), *values, module=module)
        return taken

    return run


def test_assemble_runs_every_step_once(pipeline, tmp_path):
    first = pipeline("assemble", "scale=quick", "processes=1")
    assert len(first) == 2 * SUBTASKS + 5 + 2 + SUBTASKS + 1
    plain = "terminal_reward={score: terminal, baseline: none}"  # of T-STAR's controls, which read no others
    bonus = ("system=policy_sequencing_bonus", "seed=0", plain)
    chained = first.index(("tstar", "seed=0"))
    assert first[chained + 1] == ("policy_sequencing", *bonus, "bonus=0.25")  # what T-STAR paid is known then
    assert pipeline("assemble", "scale=quick", "processes=1") == [("plot",)]
    finished = tmp_path / "runs/table_lack/policy_sequencing/seed0/finished.json"
    finished.unlink()
    again = pipeline("assemble", "scale=quick", "processes=1")
    assert again == [
        ("policy_sequencing", "seed=0", plain),
        ("evaluate", "system=policy_sequencing", "seed=0"),
        ("plot",),
    ]


def test_assemble_tells_seeds_that_are_given_twice(pipeline):
    with pytest.raises(SystemExit, match="seeds says which seeds there are: leave out seed=5"):
        pipeline("assemble", "scale=quick", "seed=5", "seeds=[0,1]")


def test_a_momentum_is_t_stars_alone(pipeline):
    given = ["terminal_reward.baseline=running_mean", "+terminal_reward.momentum=0.05"]
    steps_taken = pipeline("assemble", "scale=quick", "processes=1", *given)
    controls = [step for step in steps_taken if step[0] == "policy_sequencing"]
    assert len(controls) == 2 and all("++terminal_reward.momentum=0.01" in step for step in controls)


@pytest.mark.parametrize(("value", "noted"), [("seed=0", True), ("training.total_steps=1000", False)])
def test_minutes_are_noted_of_what_the_scale_makes(pipeline, tmp_path, value, noted):
    pipeline("assemble", "scale=quick", "processes=1", value)
    assert (tmp_path / "results/assemble.csv").is_file() == noted


def test_baselines_are_made_once(pipeline):
    values = ["scale=whole_quick", "only=[bc,ppo]", "processes=1"]
    assert [step[0] for step in pipeline("baselines", *values)] == [
        "make_demonstrations", "bc", "evaluate", "ppo", "evaluate",
    ]  # fmt: skip
    assert pipeline("baselines", *values) == []
