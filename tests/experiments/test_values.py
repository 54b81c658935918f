"""The values of a declared experiment are checked before anything runs."""

import pytest
import yaml
from recipe_runs import ROOT
from small_experiment import SMALL

from tstar_rl.experiments.values import parse_experiment


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tasks": ["nix"]}, "a task must be one of .*got 'nix'"),
        (
            {"tasks": ["table_lack", "table_lack"]},
            "experiment.tasks must name at least one, and each once; got table_",
        ),
        ({"tasks": "table_lack"}, "experiment.tasks must be a list, each text, got 'table_lack'"),
        ({"seeds": ["01"]}, "experiment.seeds must be a list, each a whole number, got"),
        ({"seeds": 3}, "experiment.seeds must be a list, each a whole number, got 3"),
        (
            {"seeds": [-1]},
            r"experiment.seeds must be a list of whole numbers from 0 to 4294967295, got \(-1,\)",
        ),
        (
            {"seeds": [0, 2**32]},
            r"experiment.seeds must be a list of whole numbers from 0 to 4294967295, got",
        ),
        (
            {
                "seeds_by_task": {"table_lack": [8]},
                "arms": [{"name": "tstar", "recipe": "tstar", "seeds": [7]}],
            },
            "tstar has seeds 7, which no task has; there are 8",
        ),
        ({"seeds": [7, 7]}, "experiment.seeds must name at least one, and each once; got 7, 7"),
        ({"seeds": []}, "experiment.seeds must name at least one, and each once; got none"),
        (
            {"seeds_by_task": {"table_lack": 3}},
            "experiment.seeds_by_task.table_lack must be a list of whole numb",
        ),
        ({"seeds_by_task": [3]}, "experiment.seeds_by_task must be a section, got"),
        (
            {"overrides": "chain.rounds=1"},
            "experiment.overrides must be a list, each text, got 'chain.rounds=1'",
        ),
        ({"arms": []}, "experiment.arms must name at least one, got none"),
        (
            {"arms": [{"name": "a", "recipe": "tstar", "skill_overrides": ["env={arm_noise: 0.8}"]}]},
            r"a must name each setting of its skills' world by itself, as in env.arm_noise=0.2; got env=\{arm_noise",
        ),
        ({"arms": ["tstar"]}, "experiment.arms must be a list, each a section, got"),
        ({"arms": [{"name": "a", "recipe": "nix"}]}, "a has the recipe nix; there is no recipes/nix.py"),
        ({"arms": [{"name": "a", "recipe": "tstar", "skills": "nix"}]}, "a has the recipe nix"),
        (
            {"arms": [{"name": "a", "recipe": "tstar", "seeds": [8, -8]}]},
            "seeds of a must be a list of whole numbers",
        ),
        (
            {"arms": [{"name": "a", "recipe": "tstar", "overrides": "x=1"}]},
            "an arm of the experiment.overrides must",
        ),
        ({"seeds_by_task": {"toy_table": [7]}}, "seeds_by_task names toy_table; tasks are table_lack"),
        ({"arm": []}, "experiment has no arm; it has name, page, scale"),
        ({"arms": [{"name": "a"}]}, "an arm of the experiment lacks recipe"),
        (
            {"arms": [{"name": "a", "recipe": "ppo", "whole": True, "skills": "bc", "bonus_of": "b"}]},
            "a is one policy for the whole task, which has no bonus_of, skills",
        ),
        (
            {"arms": [{"name": "a", "recipe": "tstar", "whole": True}]},
            "a is one policy for the whole task, which recipe tstar does not train",
        ),
        (
            {"arms": [{"name": "no_finetuning", "recipe": "no_finetuning", "overrides": ["chain.links=2"]}]},
            "no_finetuning trains nothing, so that overrides would do nothing",
        ),
        (
            {"arms": [{"name": "a", "recipe": "tstar", "seeds": [7, 20]}]},
            "a has seeds 20, which no task has; there are 7",
        ),
        (
            {
                "arms": [
                    {"name": "no_finetuning", "recipe": "no_finetuning"},
                    {"name": "a", "recipe": "policy_sequencing", "bonus_of": "no_finetuning"},
                ]
            },
            "a has the bonus of no_finetuning, which trains no chain and pays none",
        ),
        (
            {
                "arms": [
                    {"name": "whole", "recipe": "ppo", "whole": True},
                    {"name": "a", "recipe": "policy_sequencing", "bonus_of": "whole"},
                ]
            },
            "a has the bonus of whole, which trains no chain and pays none",
        ),
        ({"demonstrations_dir": "elsewhere"}, "experiment.demonstrations_dir is no value of the file"),
        ({"arms": [{"name": "a", "recipe": "tstar"}] * 2}, "two arms of one name: a, a"),
        (
            {"arms": [{"name": "a", "recipe": "no_finetuning"}]},
            "a trains nothing, so call it no_finetuning...",
        ),
        (
            {"arms": [{"name": "no_finetuning_floored", "recipe": "floored"}]},
            "no_finetuning_floored is trained by floored, .* call it otherwise",
        ),
        (
            {"arms": [{"name": "a", "recipe": "tstar", "skills_of": "b"}, {"name": "b", "recipe": "tstar"}]},
            "a has the skills of b; .* arms with skills of their own are none",
        ),
        (
            {
                "arms": [
                    {"name": "a", "recipe": "tstar", "skills_of": "b"},
                    {"name": "b", "recipe": "tstar", "skills": "bc", "skill_overrides": ["bc.epochs=2"]},
                ]
            },
            "a has the skills of b, which are trained by bc; it must have skills: bc, got gail_ppo",
        ),
        (
            {"arms": [{"name": "a", "recipe": "policy_sequencing", "bonus_of": "b"}]},
            "a has the bonus of b; seed 7 has a",
        ),
        (
            {"arms": [{"name": "a", "recipe": "policy_sequencing", "bonus_of": "a"}]},
            "a has the bonus of a, which is paid another's itself",
        ),
    ],
)
def test_what_is_no_experiment_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        parse_experiment({**SMALL, **change})


def test_the_experiment_that_usage_shows_is_one():
    shown = (ROOT / "docs" / "usage.md").read_text().split("# @package experiment\n")[1].split("```")[0]
    values = yaml.safe_load(shown.replace("hand_high", "feasibility"))  # the reader's own recipe
    declared = parse_experiment(values)
    assert [arm.name for arm in declared.arms_of(2000)][-1] == "mine_bonus"
    assert declared.arms[-1].bonus_of == "mine"
