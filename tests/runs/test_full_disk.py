"""A disk that is full or may not be written to: a sentence says so, tables and checkpoints stay as they were."""

import errno
import os
import subprocess

import numpy as np
import pandas as pd
import pytest
import torch
from saved_run import a_run, a_run_that_saved, contents

from tstar_envs.rendering import write_mp4
from tstar_rl.config.command_line import told_in_words
from tstar_rl.runs import checkpoint, files
from tstar_rl.runs.csv_tables import MetricsLog, append_rows


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


def test_many_tensors_that_do_not_fit_leave_the_checkpoint_before(tiny_disk):
    layers = torch.nn.Sequential(
        *(torch.nn.Linear(20, 20) for _ in range(300))
    )  # 500 kB, which torch maps one by one
    checkpoint.save(tiny_disk / "last", {"module": layers[:1]}, {})
    before = contents(tiny_disk)
    with pytest.raises(SystemExit, match=r"no space left on the disk for \S+/last"), told_in_words():
        checkpoint.save(tiny_disk / "last", {"module": layers}, {})
    assert contents(tiny_disk) == before


def test_a_film_that_does_not_fit_is_told_in_words(tiny_disk):
    (tiny_disk / "filler").write_bytes(b"0" * 190_000)
    noise = np.random.default_rng(0).integers(0, 255, (30, 240, 320, 3), dtype=np.uint8)
    with pytest.raises(SystemExit, match=r"no space left on the disk for \S+/film.mp4"), told_in_words():
        write_mp4(tiny_disk / "film.mp4", noise)
    assert not (tiny_disk / "film.mp4").exists()
    (tiny_disk / "filler").unlink()
    write_mp4(tiny_disk / "film.mp4", noise[:1])
    assert (tiny_disk / "film.mp4").stat().st_size > 1000


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
        (
            errno.EROFS,
            r"^a/b.csv cannot be read or written \(Read-only file system\): results_dir=\.\.\. runs_dir=",
        ),
        (
            errno.ENOTDIR,
            r"^a/b.csv cannot be read or written \(Not a directory\): results_dir=\.\.\. runs_dir=",
        ),
        (
            errno.EACCES,
            r"^a/b.csv cannot be read or written \(Permission denied\): results_dir=\.\.\. runs_dir=",
        ),
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
            pytest.raises(SystemExit, match=r"read_only/\S+ cannot be read or written \(.*results_dir="),
            told_in_words(),
        ):
            a_run(folder)
    finally:
        if os.geteuid() == 0:
            subprocess.run(["umount", "-l", str(folder)], check=True)
