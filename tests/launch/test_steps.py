"""Which trainings of a pipeline are done, by files with made-up times."""

import shutil

import pytest
from finished_steps import finish

from tstar_rl.launch.run_folders import run_folder
from tstar_rl.launch.steps import is_done, step_config
from tstar_rl.runs.mismatch import CheckpointMismatchError

TRAIN, CHAIN = ("gail_ppo", "subtask=1"), ("tstar",)


def test_a_training_whose_results_are_gone_is_not_done(shared):
    finish(TRAIN, shared, at=1)
    shutil.rmtree(run_folder(step_config(TRAIN, shared), "results_dir"))
    assert not is_done(TRAIN, shared)


def test_a_training_of_which_what_it_trained_is_gone_is_not_done(shared):
    finish(TRAIN, shared, at=1)
    assert is_done(TRAIN, shared)
    shutil.rmtree(run_folder(step_config(TRAIN, shared), "runs_dir") / "last")
    assert not is_done(TRAIN, shared)


def test_a_training_of_spirl_that_may_go_on_is_not_done(shared):
    step = ("spirl", "subtask=0")
    finish(step, shared, at=1)
    assert is_done(step, shared) and not is_done((*step, "spirl.total_steps=99000000"), shared)
    with pytest.raises(CheckpointMismatchError, match="spirl.total_steps was .*is 1 now"):
        is_done((*step, "spirl.total_steps=1"), shared)


def test_a_training_that_was_finished_with_another_config_is_no_step_that_is_done(shared):
    finish(TRAIN, shared, at=1)
    finish(CHAIN, shared, at=1)
    with pytest.raises(CheckpointMismatchError, match=r"subtask1: ppo.epochs was .*is 7 now \(resume=false"):
        is_done(TRAIN, [*shared, "ppo.epochs=7"])
    with pytest.raises(CheckpointMismatchError, match="chain.rounds was 1 .* and is 9 now"):
        is_done(CHAIN, [*shared, "chain.rounds=9"])
    assert is_done(TRAIN, [*shared, "chain.rounds=9"])  # a skill's own training reads nothing of the chain
    assert is_done(TRAIN, [*shared, "nthread=2", "evaluation.episodes=3"])
    assert is_done(CHAIN, [*shared, "ppo.epochs=7"], ignored=["ppo"])


def test_clones_are_done_whatever_a_training_that_they_do_not_have_is_given(shared):
    finish(("bc", "subtask=0"), shared, at=1)
    for number in (1, 99_000_000):
        assert is_done(("bc", "subtask=0", f"training.total_steps={number}"), shared)


def test_a_training_that_may_go_on_is_not_done_if_more_steps_are_asked_for(shared):
    more, fewer = "training.total_steps=99000000", "training.total_steps=99"
    finish(TRAIN, shared, at=1)
    finish(CHAIN, shared, at=1)
    with pytest.raises(CheckpointMismatchError, match="training.total_steps was"):
        is_done(TRAIN, [*shared, more])  # its exploration ends with the run
    free = [*shared, "exploration=null"]
    finish(TRAIN, free, at=1)
    assert is_done(TRAIN, free) and not is_done(TRAIN, [*free, more])
    with pytest.raises(CheckpointMismatchError, match="training.total_steps was .*is 99 now"):
        is_done(TRAIN, [*free, fewer])
