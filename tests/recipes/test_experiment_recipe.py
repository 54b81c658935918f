"""The queue of a declared experiment, its steps faked: what it runs, with whose code, and how it ends."""

import shutil
import subprocess
from pathlib import Path

import pytest
import torch
import yaml
from finished_steps import composed

from tstar_rl.launch.run_folders import run_folder
from tstar_rl.launch.side_by_side import Step
from tstar_rl.runs import checkpoint

ROOT = Path(__file__).resolve().parents[2]
SHELF = ROOT / "configs/experiment/shelf.yaml"
FEW = "arms=[no_finetuning]"
ARMS = {"no_finetuning", "floored", "gaussian", "tstar", "buffer_costliest", "in_order_cloned"}


def test_every_step_of_a_seed_is_run_with_the_code_of_its_commit(queue):
    taken = queue()
    steps = [step for step, _, _ in taken]
    assert steps[0][0] == "make_demonstrations" and steps[-1][0] == "evaluate"
    trained = [step for step in steps if step[0] == "gail_ppo"]
    assert [step[-1] for step in trained] == ["subtask=0", "subtask=1"]
    evaluated = {
        value.removeprefix("system=") for step in steps if step[0] == "evaluate" for value in step[1:]
    }
    assert evaluated >= ARMS
    assert all("task=chair_agne" in step and "seed=310" in step for step in steps)
    assert {seconds for _, seconds, _ in taken} == {None}
    assert {code.name for _, _, code in taken} == {yaml.safe_load(SHELF.read_text())["commit"]}


def test_an_arm_that_names_a_commit_is_run_with_that_ones_code(queue):
    declared = yaml.safe_load((ROOT / "configs/experiment/beyond_tstar.yaml").read_text())
    arms = {arm["name"]: arm.get("commit", declared["commit"]) for arm in declared["arms"]}
    chosen = ("tstar", "tstar_between")
    assert arms["tstar"] != arms["tstar_between"]
    taken = queue(
        "experiment=beyond_tstar", "tasks=[table_lack]", "seeds=[200]", f"arms=[{','.join(chosen)}]"
    )
    for name in chosen:
        assert {code.name for step, _, code in taken if f"system={name}" in step} == {arms[name]}


def test_what_is_finished_is_not_run_again(queue, monkeypatch):
    import experiment

    steps = [step for step, _, _ in queue(FEW)]
    finished = steps[0]
    monkeypatch.setattr(experiment, "is_done", lambda step, **how: step == finished)
    assert [step for step, _, _ in queue(FEW)] == steps[1:]


def test_when_the_time_is_over_it_says_so_and_asks_to_be_called_again(queue, capsys):
    steps = []

    def too_long(step):
        steps.append(step)
        if step[0] == "gail_ppo":
            checkpoint.save_step(checkpoints(step), len(steps), {"module": torch.nn.Linear(1, 1)}, {})
            raise subprocess.TimeoutExpired("gail_ppo", 1.0)

    for _ in range(2):
        with pytest.raises(SystemExit) as end:
            queue("minutes=60", FEW, takes=too_long)
        assert end.value.code == 75 and steps[-1][0] == "gail_ppo"
        assert "The time is over; the same command goes on." in capsys.readouterr().out


def test_a_call_that_leaves_nothing_to_go_on_from_asks_for_more_minutes(queue):
    def too_long(step):
        raise subprocess.TimeoutExpired("gail_ppo", 1.0)

    with pytest.raises(SystemExit, match="has left anything to go on from after minutes=0.5: give it more"):
        queue("minutes=0.5", FEW, takes=too_long)


def checkpoints(step: Step) -> Path:
    return run_folder(composed(step), "runs_dir") / "checkpoints"


def test_a_step_that_fails_is_told_at_the_end(queue):
    def fails(step):
        raise SystemExit("this step failed: " + step[0])

    with pytest.raises(SystemExit, match="this step failed: make_demonstrations"):
        queue(FEW, takes=fails)


def test_where_a_step_fails_what_this_call_has_evaluated_is_published(queue, tmp_path):
    """Not what else lies there: a declared run of another call may have been made otherwise than declared."""
    figures = ["1,1"]

    def fails_after_the_first_arm(step):
        if step[0] == "evaluate":
            run = run_folder(composed(step), "results_dir")
            run.mkdir(parents=True, exist_ok=True)
            (run / "evaluation.csv").write_text(f"progress,minutes\n{figures[0]}\n")
            if "system=no_finetuning" in step:
                raise SystemExit("this step failed: " + step[0])

    shelf = tmp_path / "results/shelf/chair_agne"
    for arm, seed in (("tstar", 310), ("tstar", 1), ("mine", 310)):
        run = shelf / f"{arm}/seed{seed}"
        run.mkdir(parents=True)
        (run / "evaluation.csv").write_text("progress,minutes\n1,1\n")
    with pytest.raises(SystemExit, match="this step failed: evaluate"):
        queue("publish=true", takes=fails_after_the_first_arm)
    with pytest.raises(SystemExit, match="this step failed: evaluate"):
        queue("publish=true", "seeds=[1]", takes=fails_after_the_first_arm)  # which is not declared
    published = sorted((tmp_path / "results/published").rglob("evaluation.csv"))
    assert [
        file.relative_to(tmp_path / "results/published/shelf/chair_agne").as_posix() for file in published
    ] == [f"gail_ppo/seed310/subtask{index}/evaluation.csv" for index in range(2)]
    figures[0] = "0,1"
    with pytest.raises(SystemExit, match="this step failed: evaluate\npublished before with other figu"):
        queue("publish=true", takes=fails_after_the_first_arm)


def test_what_is_published_is_not_run_again(queue, tmp_path):
    """A published arm is left out; one of which a table is missing is not."""
    place = tmp_path / "results/published/shelf/chair_agne"
    for arm in ARMS:
        shutil.copytree(
            ROOT / "results/published/shelf/chair_agne" / arm / "seed310", place / arm / "seed310"
        )
    asked = ("unpublished=true", f"arms=[{','.join(sorted(ARMS))}]")  # an arm may be declared and not run yet
    assert queue(*asked) == []
    (place / "tstar/seed310/evaluation.csv").unlink()
    systems = {value for step, _, _ in queue(*asked) for value in step if value.startswith("system=")}
    assert "system=tstar" in systems and "system=gaussian" not in systems
