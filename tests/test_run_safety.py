"""What a run does not lose: two runs in one folder, a full disk, a folder that cannot be written to, a dirty tree."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
import torch

from tstar_rl.config.command_line import told_in_words
from tstar_rl.runs import checkpoint, files, lock, run_folder
from tstar_rl.runs.csv_tables import LogError, MetricsLog, append_rows
from tstar_rl.runs.lock import RunInUseError
from tstar_rl.runs.run import Run

ROOT = Path(__file__).resolve().parent.parent
HOLD = "import sys; from pathlib import Path; from tstar_rl.runs import lock; lock.hold(Path(sys.argv[1])); "


def a_run(folder: Path, resume: bool = True, **values) -> Run:
    config = {
        "task": {"name": "table"},
        "system": "chain",
        "seed": 0,
        "resume": resume,
        "progress_bar": False,
    }
    places = {"results_dir": str(folder / "results"), "runs_dir": str(folder / "runs")}
    return Run({**config, **places, **values})


def other_process(code: str, *arguments: str) -> subprocess.Popen[str]:
    path = os.pathsep.join([str(ROOT), str(ROOT / "envs")])
    command = [sys.executable, "-c", HOLD + code, *arguments]
    pipe = subprocess.PIPE
    return subprocess.Popen(
        command, env={**os.environ, "PYTHONPATH": path}, stdout=pipe, stdin=pipe, text=True
    )


def contents(folder: Path) -> dict[str, bytes]:
    """Every file of a folder but the lock, which says who holds it."""
    return {
        str(p.relative_to(folder)): p.read_bytes()
        for p in folder.rglob("*")
        if p.is_file() and p.name != "lock"
    }


def a_run_that_saved(folder: Path) -> torch.nn.Module:
    """A run with two rows, of which its checkpoint has one; its module's weight is 1."""
    module = torch.nn.Linear(1, 1)
    module.weight.data.fill_(1.0)
    run = a_run(folder)
    run.start(module=module)
    run.log(10, success_rate=0.5)
    run.save_if_due(0)
    run.log(20, success_rate=0.6)
    return module


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


def test_a_folder_is_free_when_its_run_has_finished(tmp_path):
    run = a_run(tmp_path)
    run.start()
    run.finish()
    other = other_process("print('held')", str(run.work))
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


def full_disk(monkeypatch, after: int = 3) -> None:
    """Every write through `append_text` takes `after` bytes and then finds the disk full."""

    class Full:
        def __init__(self, file):
            self.file, self.left = file, after

        def __getattr__(self, name):
            return getattr(self.file, name)

        def write(self, data):
            if not self.left:
                raise OSError(errno.ENOSPC, "No space left on device")
            written, self.left = self.file.write(bytes(data[: self.left])), 0
            return written

        def __enter__(self):
            return self

        def __exit__(self, *error):
            self.file.close()

    monkeypatch.setattr(files, "_open_at_end", lambda path: Full(path.open("ab", buffering=0)))


def test_a_row_that_finds_the_disk_full_leaves_the_table_as_it_was(tmp_path, monkeypatch):
    log = MetricsLog(tmp_path / "log.csv")
    log.append({"a": 1})
    with monkeypatch.context() as patch:
        full_disk(patch)
        with pytest.raises(OSError, match="No space left on device.*log.csv"):
            log.append({"a": 22222})
    assert (tmp_path / "log.csv").read_text() == "a\n1\n"
    log.append({"a": 3})
    assert (tmp_path / "log.csv").read_text() == "a\n1\n3\n"


@pytest.fixture
def tiny_disk(tmp_path):
    """A file system of 200 kB."""
    folder = tmp_path / "tiny"
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=200k", "tmpfs", str(folder)]
    if os.geteuid() or subprocess.run(command, capture_output=True, check=False).returncode:
        pytest.skip("only root may mount a small file system")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


def test_a_checkpoint_that_does_not_fit_leaves_the_one_before(tiny_disk):
    module = a_run_that_saved(tiny_disk)
    before = contents(tiny_disk)
    (tiny_disk / "filler").write_bytes(b"0" * 50_000)
    run = a_run(tiny_disk)
    large = torch.nn.Linear(200, 200)  # 160 kB
    with pytest.raises(OSError, match=r"No space left on device.*checkpoints/checkpoint-"):
        checkpoint.save_step(run.work / "checkpoints", 30, {"module": large}, run.record)
    (tiny_disk / "filler").unlink()
    assert contents(tiny_disk) == before
    module.weight.data.zero_()
    assert a_run(tiny_disk).start(module=module) == 10 and module.weight.item() == 1.0


def test_a_table_on_a_full_disk_keeps_its_rows(tiny_disk):
    table = tiny_disk / "evaluation.csv"
    append_rows(table, [{"n": 0, "text": "kept"}], ("n",))
    with pytest.raises(OSError, match="No space left on device.*evaluation.csv"):
        append_rows(table, [{"n": 1, "text": "x" * 300_000}], ("n",))
    assert pd.read_csv(table).text.tolist() == ["kept"] and [p.name for p in tiny_disk.iterdir()] == [
        table.name
    ]


@pytest.mark.parametrize(
    ("code", "message"),
    [
        (errno.ENOSPC, r"^no space left on the disk for a/b.csv\. What was written before stays"),
        (errno.EROFS, r"^a/b.csv cannot be written \(Read-only file system\): results_dir=\.\.\. runs_dir="),
        (errno.EACCES, r"^a/b.csv cannot be written \(Permission denied\): results_dir=\.\.\. runs_dir="),
    ],
)
def test_a_disk_that_takes_no_more_is_told_in_words(code, message):
    with pytest.raises(SystemExit, match=message), told_in_words():
        raise OSError(code, os.strerror(code), "a/b.csv")


def test_a_read_only_folder_is_told_in_words(tmp_path):
    folder = tmp_path / "read_only"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "ro,size=64k", "tmpfs", str(folder)]
    if os.geteuid() == 0 and subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("root may write anywhere, and cannot mount a read-only file system here")
    folder.chmod(0o500) if os.geteuid() else None
    try:
        with (
            pytest.raises(SystemExit, match=r"read_only/\S+ cannot be written \(.*results_dir="),
            told_in_words(),
        ):
            a_run(folder)
    finally:
        if os.geteuid() == 0:
            subprocess.run(["umount", "-l", str(folder)], check=True)


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


def test_a_table_that_has_lost_rows_stops_a_run_that_resumes(tmp_path):
    a_run_that_saved(tmp_path)
    table = tmp_path / "results/table/chain/seed0/metrics.csv"
    for said, damage in (
        ("has 0 rows", lambda: table.write_text("env_steps\n")),
        ("is missing", table.unlink),
    ):
        damage()
        before = contents(tmp_path)
        with pytest.raises(LogError, match=rf"metrics.csv {said}, but its checkpoint counts 1.*resume=false"):
            a_run(tmp_path).start(module=torch.nn.Linear(1, 1))
        assert contents(tmp_path) == before


def test_another_config_stops_a_run_that_resumes_and_leaves_it_finished(tmp_path):
    a_run_that_saved(tmp_path)
    run = a_run(tmp_path)
    run.finish()
    before = contents(tmp_path)
    with pytest.raises(checkpoint.CheckpointMismatchError, match="size was None.*resume=false starts over"):
        a_run(tmp_path, size=3).start(module=torch.nn.Linear(1, 1))
    assert contents(tmp_path) == before


def test_a_commit_says_whether_the_code_differs_from_it(tmp_path, monkeypatch):
    package = tmp_path / "tstar_rl" / "runs"
    package.mkdir(parents=True)
    (package / "run_folder.py").write_text("")
    monkeypatch.setattr(run_folder, "__file__", str(package / "run_folder.py"))

    def git(*command: str) -> None:
        who = ["-c", "user.name=a", "-c", "user.email=a@b", "-c", "commit.gpgsign=false"]
        subprocess.run(["git", "-C", str(tmp_path), *who, *command], check=True, capture_output=True)

    git("init")
    assert run_folder._commit() == ""  # a repository around an installed package says nothing of it
    git("add", ".")
    git("commit", "-m", "first")
    clean = run_folder._commit()
    assert len(clean) == 40
    (tmp_path / "notes.txt").write_text("decides nothing")
    assert run_folder._commit() == clean
    (tmp_path / "new.py").write_text("")
    assert run_folder._commit() == f"{clean}-dirty"
