"""What a run does not lose: two runs in one folder, a damaged checkpoint, lost rows, a dirty tree."""

import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
import torch
from saved_run import a_run, a_run_that_saved, contents

from tstar_rl.checks import InvalidValueError
from tstar_rl.runs import checkpoint, lock, versions
from tstar_rl.runs.csv_tables import LogError
from tstar_rl.runs.lock import RunInUseError
from tstar_rl.runs.run import Run

ROOT = Path(__file__).resolve().parents[2]
HOLD = "import sys; from pathlib import Path; from tstar_rl.runs import lock; lock.hold(Path(sys.argv[1])); "


def other_process(code: str, *arguments: str) -> subprocess.Popen[str]:
    path = os.pathsep.join([str(ROOT), str(ROOT / "envs")])
    command = [sys.executable, "-c", HOLD + code, *arguments]
    pipe = subprocess.PIPE
    return subprocess.Popen(
        command, env={**os.environ, "PYTHONPATH": path}, stdout=pipe, stdin=pipe, text=True
    )


def test_the_second_of_two_runs_in_a_folder_is_stopped_and_touches_nothing(tmp_path):
    a_run_that_saved(tmp_path)
    lock.release(tmp_path / "runs/table/chain/seed0")
    before = contents(tmp_path)
    first = other_process("print('held', flush=True); input()", str(tmp_path / "runs/table/chain/seed0"))
    assert first.stdout.readline() == "held\n"
    with pytest.raises(RunInUseError, match=rf"seed0 is in use by process {first.pid} on .*wait.*runs_dir="):
        a_run(tmp_path)
    assert contents(tmp_path) == before
    first.kill()  # -9: nothing of its own runs any more
    first.wait()
    assert a_run(tmp_path).start(module=torch.nn.Linear(1, 1)) == 10


def test_a_config_without_what_a_run_needs_is_told_what(tmp_path):
    with pytest.raises(
        InvalidValueError, match="config has no seed, progress_bar; it needs task, system, seed, "
    ):
        Run({"task": {"name": "t"}, "system": "s", "results_dir": "a", "runs_dir": "b", "resume": True})


def test_a_folder_is_free_when_its_run_has_finished(tmp_path):
    run = a_run(tmp_path)
    run.start()
    run.finish()
    for folder in (run.work, run.results):
        other = other_process("print('held')", str(folder))
        assert other.communicate()[0] == "held\n"


def test_rows_that_processes_add_at_once_are_all_kept(tmp_path):
    code = (
        "from tstar_rl.runs.csv_tables import append_rows; print('ready', flush=True); input();"
        "[append_rows(sys.argv[2], [{'who': sys.argv[3], 'n': n}], ('who', 'n')) for n in range(20)]"
    )
    names = ("a", "b")
    table = str(tmp_path / "evaluation.csv")
    both = [other_process(code, str(tmp_path / name), table, name) for name in names]
    for process in both:
        assert process.stdout.readline() == "ready\n"
    for process in both:
        process.stdin.write("\n")
        process.stdin.flush()
    assert [process.wait() for process in both] == [0, 0]
    assert pd.read_csv(table).groupby("who").n.apply(list).to_dict() == {name: [*range(20)] for name in names}


def test_a_damaged_newest_checkpoint_stops_a_run_that_resumes(tmp_path):
    a_run_that_saved(tmp_path)
    run = a_run(tmp_path)
    (newest,) = (run.work / "checkpoints").glob("checkpoint-*")
    (tmp_path / "runs/table/chain/seed0/finished.json").write_text("{}")
    for name in ("manifest.json", "components/0000-module/state.tdz"):
        whole = (newest / name).read_bytes()
        (newest / name).write_bytes(whole[:-1])
        before = contents(tmp_path)
        with pytest.raises(
            checkpoint.DamagedCheckpointError, match=rf"{name} has .*resume=false starts over"
        ):
            a_run(tmp_path).start(module=torch.nn.Linear(1, 1))
        assert contents(tmp_path) == before
        (newest / name).write_bytes(whole)
    assert a_run(tmp_path).start(module=torch.nn.Linear(1, 1)) == 10


def test_a_best_whose_replacement_was_killed_is_there_after_a_resume(tmp_path):
    module = a_run_that_saved(tmp_path)
    work = tmp_path / "runs/table/chain/seed0"
    checkpoint.save(work / "best", {"module": module}, {})
    (work / "best").rename(work / ".best.old-0123456789abcdef0123456789abcdef")
    lock.release(work)
    a_run(tmp_path).start(module=torch.nn.Linear(1, 1))
    loaded = torch.nn.Linear(1, 1)
    checkpoint.load(work / "best", {"module": loaded})
    assert torch.equal(loaded.weight, module.weight)


def test_a_table_that_has_lost_rows_stops_a_run_that_resumes(tmp_path):
    a_run_that_saved(tmp_path)
    table = tmp_path / "results/table/chain/seed0/metrics.csv"
    for said, damage in (
        ("has 0 whole rows", lambda: table.write_text("env_steps\n")),
        ("has 0 whole rows", lambda: table.write_text("env_steps\n1")),
        ("has 0 whole rows", lambda: table.write_text("")),
        ("is missing", table.unlink),
        ("is damaged .its first column is not env_steps", lambda: table.write_text("qqqq\n" * 9)),
        ("is damaged .row 1 has 1 fields, and there are 2 col", lambda: table.write_text("env_steps,a\n1\n")),
        ("is damaged .'utf-8' codec", lambda: table.write_bytes(b"\xff\xfe\n" * 9)),
    ):
        damage()
        before = contents(tmp_path)
        said += "" if "damaged" in said else ", but its checkpoint counts 1"
        with pytest.raises(LogError, match=rf"metrics.csv {said}.*resume=false"):
            a_run(tmp_path).start(module=torch.nn.Linear(1, 1))
        assert contents(tmp_path) == before


def test_a_commit_says_whether_the_code_differs_from_it(tmp_path, monkeypatch):
    package = tmp_path / "tstar_rl" / "runs"
    package.mkdir(parents=True)
    (package / "versions.py").write_text("")
    monkeypatch.setattr(versions, "__file__", str(package / "versions.py"))

    def git(*command: str) -> None:
        who = ["-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false"]
        subprocess.run(["git", "-C", str(tmp_path), *who, *command], check=True, capture_output=True)

    git("init")
    assert versions.commit() == ""  # a repository around an installed package says nothing of it
    git("add", ".")
    git("commit", "-m", "first")
    clean = versions.commit()
    assert len(clean) == 40
    (tmp_path / "notes.txt").write_text("decides nothing")
    assert versions.commit() == clean
    (tmp_path / "new.py").write_text("")
    assert versions.commit() == f"{clean}-dirty"
    itself = subprocess.run

    def no_status(command, **how):
        return itself([*command[:3], "no-such-command"] if "status" in command else command, **how)

    monkeypatch.setattr(versions.subprocess, "run", no_status)
    assert versions.commit() == ""  # not known, which is not clean


def test_two_runs_do_not_write_one_results_folder(tmp_path):
    results = str(tmp_path / "results/table/chain/seed0")
    first = other_process("print('held', flush=True); input()", results)
    assert first.stdout.readline() == "held\n"
    with pytest.raises(RunInUseError, match=r"results/table/chain/seed0 is in use by process"):
        a_run(tmp_path)
    work = other_process("print('free')", str(tmp_path / "runs/table/chain/seed0"))
    assert work.communicate()[0] == "free\n"  # it did not keep what it got
    first.kill()
    first.wait()


def test_checkpoints_come_every_so_many_steps_and_hold_what_has_settled(tmp_path):
    settled = []

    class Settles(torch.nn.Linear):
        def settle(self):
            settled.append(run.env_steps)
            self.weight.data.fill_(run.env_steps)

    run = a_run(tmp_path)
    run.start(module=Settles(1, 1))
    for steps in (10, 20, 30, 40):
        run.log(steps)
        run.save_if_due(15)
    assert settled == [20, 40]
    run, module = a_run(tmp_path), Settles(1, 1)
    assert run.start(module=module) == 40 and module.weight.item() == 40
    for steps in (50, 60):
        run.log(steps)
        run.save_if_due(15)
    assert settled == [20, 40, 60]


def test_a_fork_of_the_process_that_holds_a_folder_does_not(tmp_path):
    fork = (
        "import os\n"
        "if os.fork():\n    raise SystemExit(os.waitstatus_to_exitcode(os.wait()[1]))\n"
        "try:\n    lock.hold(Path(sys.argv[1]))\n"
        "except lock.RunInUseError:\n    os._exit(7)\n"
        "os._exit(0)"
    )
    other = other_process("\n" + fork, str(tmp_path / "run"))
    other.communicate()
    assert other.returncode == 7
