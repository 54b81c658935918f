"""Runs that stop at an awkward moment, and resumes that are refused: nothing is lost, nothing is cut."""

import pytest
import torch
from saved_run import a_run, a_run_that_saved, contents

from tstar_rl.runs import checkpoint
from tstar_rl.runs.mismatch import CheckpointMismatchError


def test_a_run_that_was_stopped_between_what_it_trained_and_its_end_begins_anew(tmp_path):
    """It has no checkpoint to go on from; what it had trained is made again."""
    run = a_run(tmp_path)
    run.start(module=torch.nn.Linear(1, 1))
    checkpoint.save(run.work / "last", {"module": torch.nn.Linear(1, 1)}, {})
    again = a_run(tmp_path)
    assert again.start(module=torch.nn.Linear(1, 1)) == 0 and not (again.work / "last").exists()
    checkpoint.save(again.work / "last", {"module": torch.nn.Linear(1, 1)}, {})
    again.finish()
    assert sorted(path.name for path in again.work.iterdir()) == ["finished.json", "last", "lock"]


def test_a_resume_that_is_refused_late_leaves_the_tables_as_they_are(tmp_path):
    """A component that does not load comes after the run, whose rows go back to the checkpoint."""
    a_run_that_saved(tmp_path)
    before = contents(tmp_path)
    with pytest.raises(CheckpointMismatchError, match="resume=false starts over"):
        a_run(tmp_path).start(module=torch.nn.Linear(2, 1))
    with pytest.raises(CheckpointMismatchError, match="resume=false starts over"):
        a_run(tmp_path).start(module=torch.nn.Linear(1, 1), zest=torch.nn.Linear(1, 1))
    assert contents(tmp_path) == before


def test_a_recipes_own_key_may_be_called_as_an_argument_is(tmp_path):
    own = {"path": "mine", "components": 3}
    run = a_run(tmp_path, **own)
    run.start(module=torch.nn.Linear(1, 1))
    run.log(10)
    run.save_if_due(0)
    assert a_run(tmp_path, **own).start(module=torch.nn.Linear(1, 1)) == 10
