"""Which evaluation is the one that is asked for, and of which runs it is, by files with made-up times."""

import pytest
from finished_steps import SUBTASKS, finish
from hydra import compose, initialize_config_dir

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.values import CONFIGS, plain
from tstar_rl.env.task_tables import furniture_digest
from tstar_rl.launch.evaluations import check_chain, check_evaluation
from tstar_rl.launch.run_folders import begun_with, evaluated_runs, run_folder
from tstar_rl.launch.steps import is_done, missing, step_config
from tstar_rl.runs.csv_tables import LogError
from tstar_rl.runs.mismatch import CheckpointMismatchError
from tstar_rl.runs.run_config import note_evaluation, read_config, write_config

TRAIN, EVALUATE = ("gail_ppo", "subtask=1"), ("evaluate", "system=gail_ppo", "subtask=1")
CHAIN, TRIED = ("tstar",), ("evaluate", "system=tstar")


@pytest.mark.parametrize(("train", "evaluate"), [(TRAIN, EVALUATE), (CHAIN, TRIED)])
def test_an_evaluation_is_done_if_it_is_not_older_than_its_training(shared, train, evaluate):
    assert missing([train, evaluate], shared) == [train, evaluate]
    finish(evaluate, shared, at=100)  # a table of a run that is gone
    assert missing([train, evaluate], shared) == [train, evaluate]
    finish(train, shared, at=101)
    assert missing([train, evaluate], shared) == [evaluate]
    finish(evaluate, shared, at=101)
    assert missing([train, evaluate], shared) == []
    assert missing([train, evaluate], [*shared, "seed=1"]) == [train, evaluate]
    assert missing([train, evaluate], [*shared, "resume=false"]) == [train, evaluate]


def test_an_evaluation_of_a_training_that_goes_on_is_made_again(shared):
    shared = [*shared, "exploration=null"]  # with it, the steps of a training cannot be raised
    other = ("evaluate", "system=gail_ppo", "subtask=2")
    for step in (TRAIN, EVALUATE, ("gail_ppo", "subtask=2"), other):
        finish(step, shared, at=100)
    assert missing([TRAIN, EVALUATE, other], shared) == []
    more = [*shared, "training.total_steps=100000000"]
    assert missing([TRAIN, EVALUATE, other], more) == [TRAIN, EVALUATE]


def test_an_evaluation_without_fine_tuning_is_as_old_as_the_newest_skill_allows(shared):
    step = ("evaluate", "system=no_finetuning")
    for index in range(SUBTASKS):
        finish(("gail_ppo", f"subtask={index}"), shared, at=10 + index)
    finish(step, shared, at=13)
    assert is_done(step, shared)
    finish(("gail_ppo", "subtask=2"), shared, at=14)
    assert not is_done(step, shared)
    assert not is_done(step, [*shared, "skills=others"])
    assert not is_done(("evaluate", "system=no_finetuning_narrow", "chain.links=2"), shared)


def test_an_evaluation_of_another_world_or_of_other_skills_is_not_taken_for_the_one_that_is_asked_for(shared):
    for index in range(SUBTASKS):
        finish(("gail_ppo", f"subtask={index}"), shared, at=1)
        finish(("bc", f"subtask={index}"), shared, at=1)
    finish(CHAIN, shared, at=1)
    finish(TRIED, shared, at=2)
    with pytest.raises(
        CheckpointMismatchError, match="tstar/seed0 has .*env.part_noise was None .*is 0.06 now"
    ):
        is_done(TRIED, [*shared, "+env.part_noise=0.06"])
    step = ("evaluate", "system=no_finetuning")
    finish(step, shared, at=2)
    config = step_config(step, shared)
    note_evaluation(run_folder(config, "results_dir"), plain(config))
    assert is_done(step, shared)
    for other, message in (("skills=bc", "skills was 'gail_ppo'"), ("chain.links=2", "links was None")):
        with pytest.raises(CheckpointMismatchError, match=f"{message}.*another system=no_finetuning_<name>"):
            is_done((*step, other), shared)
    with pytest.raises(InvalidValueError, match="system=gail_ppo subtask=2 is the skill"):
        evaluated_runs(step_config((*step, "subtask=2"), shared))


def test_what_was_made_of_another_file_of_furniture_is_not_done(shared):
    """A training and its evaluation; a step with the code of another commit has that commit's furniture."""
    folder = run_folder(step_config(TRAIN, shared), "results_dir")

    def noting(digest: str) -> None:
        write_config(folder, read_config(folder) | {"furniture": digest})

    finish(TRAIN, shared, at=1)
    finish(EVALUATE, shared, at=1)
    assert missing([TRAIN, EVALUATE], shared) == []  # an older version noted no furniture
    noting(furniture_digest("table_lack"))
    assert missing([TRAIN, EVALUATE], shared) == []
    noting("0" * 64)
    with pytest.raises(
        CheckpointMismatchError, match=f"{folder}: the task's file of furniture said something"
    ):
        is_done(TRAIN, shared)
    with pytest.raises(CheckpointMismatchError, match=f"{folder} has the results of another table_lack.yaml"):
        is_done(EVALUATE, shared)
    assert is_done(TRAIN, shared, other_code=True) and is_done(EVALUATE, shared, other_code=True)


def test_a_chain_is_asked_in_the_world_that_it_was_trained_in(tmp_path):
    values, config = [f"results_dir={tmp_path}"], {}
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        for scale in ("laptop", "no_return"):
            config[scale] = compose("recipe/hand_over", [*values, f"scale={scale}"])
    write_config(tmp_path / "table_lack/tstar/seed0", plain(config["no_return"]) | {"system": "tstar"})
    check_chain(config["no_return"], "tstar")
    check_chain(config["laptop"], "policy_sequencing")  # of which nothing is there
    with pytest.raises(CheckpointMismatchError, match="results of something else: .*env.reset_robot"):
        check_chain(config["laptop"], "tstar")


def test_a_chain_began_with_the_skills_that_its_training_noted(tmp_path):
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/exchanged", [f"results_dir={tmp_path}", "skills=gail_ppo"])
    trained, untrained = tmp_path / "table_lack/in_order/seed0", tmp_path / "table_lack/no_finetuning/seed0"
    noted = plain(config) | {"skills": "bc", "from_checkpoint": "best"}
    write_config(trained, noted)
    write_config(untrained, noted | {"evaluation_only": True})
    assert begun_with(trained, config) == ("bc", "best")
    assert begun_with(untrained, config) == begun_with(tmp_path, config) == ("gail_ppo", "last")


def test_an_evaluation_has_all_modes_and_the_episodes_that_are_asked_for(shared):
    finish(TRAIN, shared, at=1)
    finish(EVALUATE, shared, at=2, modes=("deterministic",))
    assert not is_done(EVALUATE, shared) and is_done((*EVALUATE, "modes=[deterministic]"), shared)
    finish(EVALUATE, shared, at=2)
    assert is_done(EVALUATE, shared)
    assert not is_done((*EVALUATE, "evaluation.episodes=777"), shared)
    assert is_done((*EVALUATE, "evaluation.whole_episodes=777"), shared)  # this is one subtask
    assert not is_done((*EVALUATE, "checkpoints=[best]"), shared)


def test_a_table_that_is_no_evaluation_is_named(shared):
    finish(TRAIN, shared, at=1)
    finish(EVALUATE, shared, at=2)
    file = run_folder(step_config(EVALUATE, shared), "results_dir") / "evaluation.csv"
    file.write_text("checkpoint,mode\nlast,deterministic\n")
    with pytest.raises(
        LogError, match=r"evaluation.csv is damaged \(it has no column seed, episodes\): put it back"
    ):
        is_done(EVALUATE, shared)


def test_an_evaluation_has_every_checkpoint_that_its_run_has_left(shared):
    finish(TRAIN, shared, at=1)
    finish(EVALUATE, shared, at=2)
    (run,) = evaluated_runs(step_config(EVALUATE, shared))
    assert is_done(EVALUATE, shared)
    (run / "best").mkdir()  # the table has no row of it
    assert not is_done(EVALUATE, shared) and is_done((*EVALUATE, "checkpoints=[last]"), shared)


def test_another_simulator_or_device_is_noted_and_of_untrained_skills_refused(tmp_path):
    trained, untrained = tmp_path / "trained", tmp_path / "untrained"
    write_config(trained, {"env": {}, "device": "cpu", "physics": "mujoco"})
    note_evaluation(trained, {"device": "cpu", "physics": "mujoco"})
    assert "later" not in read_config(trained)
    for _ in range(2):
        note_evaluation(trained, {"env": {}, "device": "cpu", "physics": "warp"})
    (later,) = read_config(trained)["later"]
    assert later["physics"] == "warp" and "device" not in later
    note_evaluation(untrained, {"env": {}, "device": "cpu", "physics": "mujoco"})
    with pytest.raises(CheckpointMismatchError, match="results of something else: physics was 'mujoco'"):
        check_evaluation(untrained, {"env": {}, "device": "cpu", "physics": "warp"})
