"""The page of an experiment over several tasks: which it aggregates, what it answers, and a line for each task."""

import pytest
from made_up_shelf import PAPER, RUNS, add_skills, contents, section, write_shelf

from tstar_rl.analysis import read_experiment
from tstar_rl.analysis.over_tasks import skills_of_tasks
from tstar_rl.analysis.page import results_page
from tstar_rl.analysis.page.contents import read_contents


def test_a_task_whose_skills_are_not_good_enough_is_named_and_left_out(tmp_path):
    third = {"third": RUNS["long"]}
    root = write_shelf(tmp_path, {**RUNS, **third})
    good = [[1.0, 0.9, 1.0, 1.0], [1.0] * 4]  # .95 on average, which is enough
    unused = [0.0] * 4  # of a third seed, which no arm has
    add_skills(root, {"long": [*good, unused], "third": good, "short": [[1.0, 0.95], [1.0, 0.89]]})
    experiment = read_experiment(root / "shelf")
    assert skills_of_tasks(experiment, "base") == {
        "long": pytest.approx([1.0, 0.95, 1.0, 1.0]),
        "third": pytest.approx([1.0, 0.95, 1.0, 1.0]),
        "short": pytest.approx([1.0, 0.92]),
    }
    asked = {"asks": "Does T-STAR help?", "pair": ["tstar", "base"], "runs": 6}
    contents(root, reference="base", least_skill=0.95, task_questions=[asked], sections=["long"])
    found = section(root)
    assert "less than 0.95 from its own starts, mean over seeds: `short` (1.000 0.920)." in found
    assert "Over all 2 tasks: `long`, `third`." in found
    # On two tasks T-STAR is ahead on both seeds; two of two signs have a p of .5. All six runs are counted.
    assert "| Does T-STAR help? | 1.000 [" in found
    assert (
        "| [0.57, 1.00] | 2, 0, 0 (p = 0.500) | **not decided; ahead on 2 of 2 tasks, of which no number"
        in found
    )
    assert "| `short` | 1.00 0.92 | 2 | 0.600 | 0.650 |" in found
    (root / "shelf/third/gail_ppo/seed2/subtask1/evaluation.csv").unlink()
    of_third = skills_of_tasks(read_experiment(root / "shelf"), "base")["third"]
    assert of_third == [], "one skill is unknown on one seed: nothing is shown as the skills of all"
    page = results_page(root, PAPER, "")
    assert "### The shelf: long" in page and "### The shelf: short" not in page


def test_a_task_question_needs_all_its_values(tmp_path):
    shelf = write_shelf(tmp_path, RUNS)
    contents(shelf, reference="base", task_questions=[{"asks": "Does it?", "pair": ["tstar", "base"]}])
    with pytest.raises(
        ValueError, match="shelf: the question 'Does it\\?' lacks runs, which must be a whole number"
    ):
        read_contents(shelf)
