"""A run that is called again: what goes on, what begins anew, and what is refused."""

import json
import shutil

import pytest
import torch
from saved_run import a_run, a_run_that_saved, contents

from tstar_rl.checks import InvalidValueError, MissingFileError, NothingToDo
from tstar_rl.runs import checkpoint
from tstar_rl.runs.mismatch import CheckpointMismatchError
from tstar_rl.runs.run_config import note_evaluation, read_config
from tstar_rl.runs.versions import UNKNOWN


def test_another_config_stops_a_run_that_resumes_and_leaves_it_finished(tmp_path):
    a_run_that_saved(tmp_path)
    run = a_run(tmp_path)
    run.finish()
    before = contents(tmp_path)
    with pytest.raises(CheckpointMismatchError, match="size was None.*resume=false starts over"):
        a_run(tmp_path, size=3).start(module=torch.nn.Linear(1, 1))
    assert contents(tmp_path) == before


def test_a_run_that_has_finished_begins_anew_only_if_it_is_told_to(tmp_path):
    run = a_run(tmp_path)
    run.start(module=torch.nn.Linear(1, 1))
    (run.work / "last").mkdir()
    (run.results / "evaluation.csv").write_text("progress\n1\n")
    run.finish()
    before = contents(tmp_path)
    with pytest.raises(NothingToDo, match=r"seed0 has finished: nothing to do \(resume=false starts over\)"):
        a_run(tmp_path).start(module=torch.nn.Linear(1, 1))
    assert contents(tmp_path) == before
    run = a_run(tmp_path, resume=False)
    run.start(module=torch.nn.Linear(1, 1))
    assert not (run.work / "last").exists() and not (run.results / "evaluation.csv").exists()


@pytest.mark.parametrize("saved", [False, True])
def test_a_run_that_has_finished_with_tables_elsewhere_is_not_taken_for_done(saved, tmp_path):
    """With a checkpoint and without: a second results_dir would stay empty, and seem to be this run's."""
    run = a_run(tmp_path, training={"total_steps": 1})
    run.start()
    run.log(10)
    if saved:
        run.save_if_due(0)
    (run.work / "last").mkdir()
    run.finish()
    elsewhere = {"results_dir": str(tmp_path / "others"), "training": {"total_steps": 1}}
    with pytest.raises(
        MissingFileError, match="has finished, and its tables are not in .*others.*results_dir"
    ):
        a_run(tmp_path, **elsewhere).start()


def test_a_run_that_has_finished_and_has_a_checkpoint_is_not_gone_over_again(tmp_path):
    run = a_run(tmp_path, training={"total_steps": 1})
    run.start()
    run.log(10)
    run.save_if_due(0)
    run.log(15)  # a training ends between two checkpoints
    (run.work / "last").mkdir()
    run.finish()
    before = contents(tmp_path)
    with pytest.raises(NothingToDo, match="nothing to do"):
        a_run(tmp_path, training={"total_steps": 1}).start()
    assert contents(tmp_path) == before
    assert a_run(tmp_path, training={"total_steps": 20}).start() == 10  # more steps are something to do


def test_a_run_whose_config_is_lost_goes_on_and_says_so(tmp_path):
    """What it began with is not known, so that it passes for no run of one commit, and for none of another config."""
    a_run_that_saved(tmp_path)
    run = a_run(tmp_path)
    whole = read_config(run.results)
    (run.results / "config.yaml").unlink()
    run.start(module=torch.nn.Linear(1, 1))
    found = read_config(run.results)
    assert {name: found[name] for name in whole if name != "versions"} == {
        name: value for name, value in whole.items() if name != "versions"
    }
    assert found["versions"] == {"commit": UNKNOWN}
    assert [line["what"] for line in found["later"]] == ["resumed"]


def test_an_evaluation_is_of_the_steps_that_a_run_was_given(tmp_path):
    run = a_run(tmp_path, training={"total_steps": 1})
    run.start()
    run.log(10)
    run.save_if_due(0)
    run.finish()
    table = run.results / "evaluation.csv"
    table.write_text("progress\n1\n")
    a_run(tmp_path, training={"total_steps": 1}).start()
    assert table.is_file()
    a_run(tmp_path, training={"total_steps": 2}).start()
    assert not table.is_file()


def test_what_a_recipe_does_not_read_may_differ_when_its_run_is_resumed(tmp_path):
    run = a_run(tmp_path, chain={"rounds": 1})
    run.start()
    run.log(10)
    run.save_if_due(0)
    assert a_run(tmp_path, chain={"rounds": 3}, unread=("chain",)).start() == 10
    with pytest.raises(CheckpointMismatchError, match="chain.rounds was 1 .* and is 3 now"):
        a_run(tmp_path, chain={"rounds": 3}).start()


def test_more_steps_without_a_checkpoint_to_go_on_from_leave_a_run_finished(tmp_path):
    run = a_run(tmp_path, training={"total_steps": 1})
    run.start(module=torch.nn.Linear(1, 1))
    run.finish()
    before = contents(tmp_path)
    with pytest.raises(
        CheckpointMismatchError, match="no checkpoint to go on from.*resume=false starts over"
    ):
        a_run(tmp_path, training={"total_steps": 2}).start(module=torch.nn.Linear(1, 1))
    assert contents(tmp_path) == before


def test_a_run_that_begins_anew_leaves_nothing_of_the_one_before(tmp_path):
    module = a_run_that_saved(tmp_path)
    work, table = (tmp_path / root / "table/chain/seed0" for root in ("runs", "results"))
    for name in ("last", "best"):
        checkpoint.save(work / name, {"module": module}, {})
    (table / "evaluation.csv").write_text("checkpoint,success\nlast,1.0\n")
    assert a_run(tmp_path).start(module=module) == 10 and (work / "last").is_dir()
    assert a_run(tmp_path, resume=False).start(module=module) == 0
    left = {path.name for path in (*work.iterdir(), *table.iterdir())}
    assert not left & {"last", "best", "checkpoints", "evaluation.csv"} and "config.yaml" in left


@pytest.mark.parametrize("own_checkpoint", [False, True])
def test_the_tables_of_a_run_of_other_values_are_not_touched(own_checkpoint, tmp_path):
    """As where runs_dir is given and results_dir is forgotten."""
    other = a_run(tmp_path, size=1)
    other.start()
    for steps in (10, 20, 30):
        other.log(steps, progress=0.9)
    (other.results / "evaluation.csv").write_text("progress\n1\n")
    other.finish()
    mine = {"runs_dir": str(tmp_path / "mine"), "size": 2}
    if own_checkpoint:
        run = a_run(tmp_path, **mine, results_dir=str(tmp_path / "my_results"))
        run.start()
        run.log(10)
        run.save_if_due(0)
        run.finish()
    before = contents(tmp_path / "results")
    with pytest.raises(CheckpointMismatchError, match="results.*size was 1.*is 2 now.*keep runs apart"):
        a_run(tmp_path, **mine).start()
    assert contents(tmp_path / "results") == before


def test_tables_whose_run_is_elsewhere_are_not_trained_over(tmp_path):
    """As where results were copied without runs, or runs were deleted to save space."""
    run = a_run(tmp_path)
    run.start()
    run.log(10, progress=0.9)
    (run.results / "evaluation.csv").write_text("progress\n1\n")
    run.finish()
    shutil.rmtree(tmp_path / "runs")
    before = contents(tmp_path / "results")
    with pytest.raises(MissingFileError, match="nothing of it is in .*runs.*resume=false starts over"):
        a_run(tmp_path).start()
    assert contents(tmp_path / "results") == before
    assert a_run(tmp_path, resume=False).start() == 0 and not (run.results / "evaluation.csv").exists()


def test_the_config_of_an_evaluation_alone_is_no_run_to_go_on_with(tmp_path):
    """As of skills chained as they are, where a system of their name is trained later."""
    note_evaluation(tmp_path / "results/table/chain/seed0", {"size": 1})
    a_run(tmp_path, size=2).start()
    assert read_config(tmp_path / "results/table/chain/seed0")["size"] == 2


def test_two_recipes_that_were_given_one_system_do_not_go_on_with_each_other(tmp_path):
    """One that noted no recipe may be of any: an older run, or a program that makes its config itself."""
    run = a_run(tmp_path, recipe="bc")
    run.start(module=torch.nn.Linear(1, 1))
    run.log(10)
    run.save_if_due(0)
    (run.work / "last").mkdir()
    run.finish()
    for system in ("gail_ppo", "mine"):
        with pytest.raises(CheckpointMismatchError, match=f"recipe was 'bc' .*, and is '{system}' now"):
            a_run(tmp_path, recipe=system).start(module=torch.nn.Linear(1, 1))
    for same in ({"recipe": "bc"}, {}):
        with pytest.raises(NothingToDo):
            a_run(tmp_path, **same).start(module=torch.nn.Linear(1, 1))
    older = a_run(tmp_path / "older")
    older.start()
    older.finish()
    (older.work / "last").mkdir()
    with pytest.raises(NothingToDo):
        a_run(tmp_path / "older", recipe="bc").start()


def test_what_was_trained_is_not_deleted_where_the_rest_of_its_run_was_not_copied(tmp_path):
    run = a_run(tmp_path)
    checkpoint.save(run.work / "last", {"module": torch.nn.Linear(1, 1)}, {})
    before = contents(tmp_path)
    with pytest.raises(MissingFileError, match="neither finished.json nor checkpoints .*resume=false starts"):
        run.start(module=torch.nn.Linear(1, 1))
    assert contents(tmp_path) == before
    a_run(tmp_path, resume=False).start(module=torch.nn.Linear(1, 1))
    assert not (run.work / "last").exists()


def test_a_run_notes_what_it_is_told_when_it_begins_anew(tmp_path):
    for steps, resume in ((1, True), (2, True), (3, False)):
        run = a_run(tmp_path, resume=resume, notes={"skills_took": {"env_steps": steps}})
        run.start()
        run.log(10)
        run.save_if_due(0)
        run.finish()
        assert read_config(run.results)["skills_took"] == {"env_steps": 1 if resume else 3}


def test_a_folder_of_something_else_is_told_before_anything_is_deleted(tmp_path):
    a_run_that_saved(tmp_path)
    best = tmp_path / "runs/table/chain/seed0/best"
    best.mkdir()
    (best / "notes.txt").write_text("mine")
    before = contents(tmp_path)
    for resume in (True, False):
        with pytest.raises(
            InvalidValueError, match=r"best holds notes\.txt, which a checkpoint there would replace"
        ):
            a_run(tmp_path, resume=resume).start(module=torch.nn.Linear(1, 1))
        assert contents(tmp_path) == before


def test_minutes_are_of_all_calls(tmp_path):
    run = a_run(tmp_path, training={"total_steps": 20})
    run.start()
    run.seconds = 120.0
    run.log(10)
    run.save_if_due(0)
    again = a_run(tmp_path, training={"total_steps": 20})
    again.start()
    again.log(20)
    again.finish()
    assert 2.0 <= json.loads((again.work / "finished.json").read_text())["minutes"] < 3.0
