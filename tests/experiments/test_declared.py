"""A declared experiment: its arms and steps, and what waits for another arm."""

from dataclasses import replace

import pytest
import yaml
from hydra import compose, initialize_config_dir
from small_experiment import SMALL

from tstar_rl.config.values import CONFIGS, plain
from tstar_rl.experiments.values import parse_experiment
from tstar_rl.launch.bonus import without_bonus


def test_the_steps_of_a_seed():
    steps = parse_experiment(SMALL).steps(2, 7)
    assert [step[0] for step in steps[:6]] == ["make_demonstrations", "gail_ppo", "evaluate"] * 2
    chains = [(step[0], step[1].removeprefix("system=")) for step in steps[6:]]
    assert chains == [
        ("evaluate", "no_finetuning"),  # has nothing to train
        ("tstar", "tstar"),
        ("evaluate", "tstar"),
        ("policy_sequencing", "paid"),  # after the arm whose bonus it takes
        ("evaluate", "paid"),
    ]
    assert "d_omega.steps=3" in steps[7] and "bonus_of=tstar" in steps[9]


def test_an_arm_may_start_from_other_skills():
    outset = {
        "name": "outset",
        "recipe": "policy_sequencing",
        "skills": "bc",
        "overrides": ["chain.gate=false"],
    }
    steps = parse_experiment({**SMALL, "arms": [*SMALL["arms"], outset]}).steps(2, 7, ["outset"])
    made = ["make_demonstrations"] * 2  # no gail_ppo: nobody starts from its skills
    assert [step[0] for step in steps] == [*made, "bc", "bc", "policy_sequencing", "evaluate"]
    assert steps[2:4] == [("bc", "subtask=0"), ("bc", "subtask=1")]
    assert all("skills=bc" in step for step in steps[4:]) and "chain.gate=false" in steps[4]


def test_an_arm_may_be_one_policy_for_the_whole_task():
    noisy = {"name": "bc_noisy", "recipe": "bc", "overrides": ["demonstrations.kind=noisy"], "whole": True}
    experiment = parse_experiment({**SMALL, "arms": [noisy, {"name": "ppo", "recipe": "ppo", "whole": True}]})
    assert experiment.steps(4, 7) == [
        ("make_demonstrations", "whole=true"),  # and no skills
        ("bc", "system=bc_noisy", "demonstrations.kind=noisy"),
        ("evaluate", "system=bc_noisy", "video=false"),
        ("ppo", "system=ppo"),
        ("evaluate", "system=ppo", "video=false"),
    ]
    beside_chains = parse_experiment({**SMALL, "arms": [noisy, *SMALL["arms"]]}).steps(2, 7)
    assert beside_chains[0] == ("make_demonstrations", "whole=true")
    assert beside_chains[1:3] == [("make_demonstrations", "subtask=0"), ("gail_ppo", "subtask=0")]


def test_an_arm_may_have_skills_of_its_own():
    wide = {"name": "no_finetuning_wide", "recipe": "no_finetuning", "skill_overrides": ["env.arm_noise=0.8"]}
    steps = parse_experiment({**SMALL, "arms": [*SMALL["arms"], wide]}).steps(1, 7, ["no_finetuning_wide"])
    own = ("subtask=0", "demonstrations_dir=demonstrations/small/no_finetuning_wide", "env.arm_noise=0.8")
    skills = "no_finetuning_wide/gail_ppo"
    assert steps == [
        ("make_demonstrations", *own),
        ("gail_ppo", f"system={skills}", *own),
        ("evaluate", f"system={skills}", *own, "video=false"),  # from the starts that they were trained from
        (
            "evaluate",
            "system=no_finetuning_wide",
            f"skills={skills}",
            "demonstrations.may_differ=[arm_noise]",
            "video=false",
        ),  # from those of all arms
    ]


def test_an_arm_is_evaluated_in_the_world_that_it_is_trained_in():
    of_world = ["+env.snap=true", "env.arm_noise=0.5"]
    arms = [
        {"name": "weld", "recipe": "tstar", "overrides": [*of_world, "d_omega.steps=8"]},
        {"name": "alone", "recipe": "ppo", "whole": True, "overrides": [*of_world, "ppo.epochs=1"]},
    ]
    steps = parse_experiment({**SMALL, "arms": arms}).steps(1, 7)
    evaluated = [step for step in steps if step[0] == "evaluate" and "system=gail_ppo" not in step]
    assert [step[-3:] for step in evaluated] == [(*of_world, "video=false")] * 2
    assert not any("steps=8" in value or "epochs=1" in value for step in evaluated for value in step)


def test_demonstrations_may_lie_elsewhere():
    wide = {"name": "no_finetuning_wide", "recipe": "no_finetuning", "skill_overrides": ["env.arm_noise=0.8"]}
    experiment = parse_experiment({**SMALL, "arms": [wide]})
    usual, elsewhere = (
        [step for _, step in replace(experiment, demonstrations_dir=place).steps_by_commit(1, 7)]
        for place in (None, "/disk")
    )
    assert "demonstrations_dir=/disk/no_finetuning_wide" in elsewhere[0]
    assert [[value.replace("/disk", "demonstrations/small") for value in step] for step in elsewhere] == [
        list(step) for step in usual
    ]


def test_a_folder_that_hydra_would_read_otherwise_is_quoted():
    wide = {"name": "no_finetuning_wide", "recipe": "no_finetuning", "skill_overrides": ["env.arm_noise=0.8"]}
    there = replace(parse_experiment({**SMALL, "arms": [wide]}), demonstrations_dir="/o'disk (1)")
    made = there.steps(1, 7)[0]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/make_demonstrations", [*made[1:3], "scale=no_return"])
    assert config.demonstrations_dir == "/o'disk (1)/no_finetuning_wide"


def test_the_first_skill_of_an_arm_may_be_trained_like_that_of_others():
    wide = {
        "name": "wide",
        "recipe": "policy_sequencing",
        "later_skill_overrides": ["env.arm_noise=0.8"],
    }
    steps = parse_experiment({**SMALL, "arms": [wide]}).steps(3, 7)
    assert [step[0] for step in steps[-2:]] == ["policy_sequencing", "evaluate"]
    noisy = [(step[0], "env.arm_noise=0.8" in step) for step in steps[:-2]]
    names = ("make_demonstrations", "gail_ppo", "evaluate")
    assert noisy == [(name, index > 0) for index in range(3) for name in names]
    assert "skills=wide/gail_ppo" in steps[-1] and "env.arm_noise=0.8" not in steps[-2]


def test_an_arm_may_start_from_the_skills_of_another():
    wide = {"name": "no_finetuning_wide", "recipe": "no_finetuning", "skill_overrides": ["env.arm_noise=0.8"]}
    mended = {"name": "mended", "recipe": "policy_sequencing", "skills_of": "no_finetuning_wide"}
    experiment = parse_experiment({**SMALL, "arms": [mended, wide]})
    own = [step for step in experiment.steps(1, 7, ["no_finetuning_wide"]) if step[1].endswith("gail_ppo")]
    both, alone = (experiment.steps(1, 7, arms) for arms in (None, ["mended"]))
    names = [step[0] for step in both]
    assert names == [
        "make_demonstrations",
        "gail_ppo",
        "evaluate",
        "policy_sequencing",
        "evaluate",
        "evaluate",
    ]
    assert own == [step for step in both if step[1].endswith("gail_ppo")]  # made once
    assert alone == both[:5]
    values = ("system=mended", "skills=no_finetuning_wide/gail_ppo")
    assert both[3][1:] == (*values, "demonstrations_dir=demonstrations/small/no_finetuning_wide")


def test_some_arms_alone():
    experiment = parse_experiment(SMALL)
    steps = experiment.steps(2, 7, ["tstar"])
    assert [step[0] for step in steps[6:]] == ["tstar", "evaluate"] and len(steps) == 8
    with pytest.raises(
        ValueError, match="arms of small are no_finetuning, paid, tstar, gaussian; got tsar, gauss"
    ):
        experiment.check_arms(["tsar", "paid", "gauss"])


def test_arms_of_another_commit_come_with_all_that_they_start_from():
    later = {"name": "later", "recipe": "tstar", "commit": "b"}
    experiment = parse_experiment({**SMALL, "commit": "a", "arms": [*SMALL["arms"], later]})
    planned = experiment.steps_by_commit(1, 7)
    assert [step for commit, step in planned if commit == "a"] == experiment.steps(
        1, 7, ["no_finetuning", "tstar", "paid"]
    )
    assert [step for commit, step in planned if commit == "b"] == experiment.steps(1, 7, ["later"])
    assert {commit for commit, _ in planned} == {"a", "b"}
    assert {commit for commit, _ in parse_experiment(SMALL).steps_by_commit(1, 7)} == {None}


def test_an_arm_with_a_commit_of_its_own_comes_before_the_arm_that_its_bonus_is_for():
    arms = [
        {"name": "a", "recipe": "policy_sequencing"},
        {"name": "paid", "recipe": "policy_sequencing", "bonus_of": "tstar"},
        {"name": "tstar", "recipe": "tstar", "commit": "2" * 40},
    ]
    steps = parse_experiment({**SMALL, "commit": "1" * 40, "arms": arms}).steps_by_commit(1, 7)
    trained = [step[1] for _, step in steps if step[0] in ("policy_sequencing", "tstar")]
    assert trained == ["system=a", "system=tstar", "system=paid"]
    skills = [commit[0] for commit, step in steps if step[0] == "gail_ppo"]
    assert skills == ["1", "2"], "once with the code of each commit"
    assert len(set(steps)) == len(steps)


@pytest.mark.parametrize("path", sorted((CONFIGS / "experiment").glob("*.yaml")), ids=lambda path: path.stem)
def test_every_declared_experiment_can_be_run(path):
    """Its page is there, no seed has tuned a setting, and every training step has a config.

    The arms' steps are tried on the first task, and those of the first arm on every task; of evaluations that differ in
    the names of arms and skills alone, one.
    """
    experiment = parse_experiment(yaml.safe_load(path.read_text()))
    assert (CONFIGS.parent / experiment.page).is_file() and experiment.name == path.stem
    assert not set(experiment.every_seed) & {0, 1, 2}
    seed = experiment.seeds[0]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        for task in experiment.tasks:
            steps = experiment.steps(
                1, seed, None if task == experiment.tasks[0] else [experiment.arms[0].name]
            )
            assert steps
            named = ("system=", "skills=")
            kinds = {
                (step[0], *(value for value in step[1:] if not value.startswith(named))): step
                for step in steps
            }
            for step in kinds.values():
                values = [*experiment.shared(task, seed), *without_bonus(step)[1:]]
                config = compose(f"recipe/{step[0]}", values)
                assert config.seed == seed and plain(config)["task"]["name"] == task
