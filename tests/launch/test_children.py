"""Recipes that run side by side end with the process that started them."""

import errno
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tstar_rl.config.values import CONFIGS
from tstar_rl.launch.children import child, end_children, run_child
from tstar_rl.launch.side_by_side import run_recipe, run_side_by_side
from tstar_rl.runs.run_folder import RECIPES

QUEUE = """
import signal, sys
from pathlib import Path
from tstar_rl.launch import side_by_side
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job inherits that it is ignored
side_by_side.RECIPES = Path(sys.argv[1])
side_by_side.run_side_by_side([[("wait", "a"), ("wait", "b")], [("wait", "c"), ("wait", "d")], [("wait", "e")]], [], 2)
"""
OUTER = """
import os, sys
from tstar_rl.launch.children import run_child
run_child([sys.executable, "-c", *sys.argv[1:]], os.environ)
"""
WAIT = """
import os, sys, time
from pathlib import Path
Path(__file__).with_name(sys.argv[1]).write_text(str(os.getpid()))
time.sleep(60)
"""


def lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def wait_for(*files: Path) -> list[int]:
    """The processes that wrote their number into these files."""
    end = time.monotonic() + 60
    while time.monotonic() < end:
        found = [file.read_text() for file in files if file.is_file()]
        if len(found) == len(files) and all(found):
            return [int(number) for number in found]
        time.sleep(0.05)
    raise AssertionError(f"only {os.listdir(files[0].parent)}")


def test_a_folder_of_configs_is_known_to_what_a_recipe_starts(tmp_path):
    (tmp_path / "mine/recipe").mkdir(parents=True)
    (tmp_path / "mine/recipe/outer.yaml").write_text("value: 1\n")
    (tmp_path / "inner.py").write_text("import sys\nprint(*sys.argv[1:])\n")
    script = tmp_path / "outer.py"
    script.write_text(
        "import hydra\nfrom pathlib import Path\nfrom tstar_rl.launch import side_by_side\n"
        "side_by_side.RECIPES = Path(__file__).parent\n"
        f"@hydra.main(version_base='1.3', config_path='{CONFIGS}', config_name='recipe/outer')\n"
        "def main(config):\n    side_by_side.run_recipe(('inner', 'a=2'), ['b=3'])\n"
        "main()\n"
    )
    command = [sys.executable, str(script), "--config-dir", "mine"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout.split() == [f"--config-dir={tmp_path / 'mine'}", "b=3", "a=2"]


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, -signal.SIGINT)])
def test_what_runs_ends_with_the_queue_and_nothing_more_is_begun(tmp_path, number, code):
    (tmp_path / "wait.py").write_text(WAIT)
    queue = subprocess.Popen([sys.executable, "-c", QUEUE, str(tmp_path)], stderr=subprocess.PIPE)
    steps = wait_for(tmp_path / "a", tmp_path / "c")
    queue.send_signal(number)  # to it alone, as `kill` does
    queue.communicate(timeout=30)
    assert queue.returncode == code
    assert not any(map(lives, steps))
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a", "c", "wait.py"]


def test_a_child_that_takes_too_long_is_killed(tmp_path):
    note = tmp_path / "note"
    with pytest.raises(subprocess.TimeoutExpired):
        run_child(["sh", "-c", f"echo $$ > {note}; exec sleep 60"], os.environ, 1)
    assert not lives(int(note.read_text()))


def test_a_child_ends_its_own_children_before_it_is_killed(tmp_path):
    """As assemble.py does when bench.py, which has started it, is told to end."""
    (tmp_path / "wait.py").write_text(WAIT)
    outer = subprocess.Popen([sys.executable, "-c", OUTER, QUEUE, str(tmp_path)], stderr=subprocess.PIPE)
    steps = wait_for(tmp_path / "a", tmp_path / "c")
    outer.terminate()
    outer.communicate(timeout=30)
    assert outer.returncode == 143 and not any(map(lives, steps))


def test_a_child_that_does_not_end_is_killed(tmp_path, monkeypatch):
    monkeypatch.setattr("tstar_rl.launch.children.GRACE", 0.2)
    note = tmp_path / "note"
    with pytest.raises(subprocess.TimeoutExpired):
        run_child(
            ["bash", "-c", f"trap '' TERM; echo $$ > {note}; while :; do sleep 0.1; done"], os.environ, 1
        )
    assert not lives(int(note.read_text()))


def test_signals_are_as_before_afterwards():
    before = signal.getsignal(signal.SIGTERM)
    assert run_child([sys.executable, "-c", "raise SystemExit(3)"], os.environ) == 3
    assert signal.getsignal(signal.SIGTERM) is before


def test_what_is_no_process_ends_with_the_rest():
    """As a task of a cluster does, which is cancelled."""
    ended = []
    with child(lambda: ended.append("task")):
        end_children()
    end_children()
    assert ended == ["task"]


def test_a_lane_that_finds_the_disk_full_says_so_and_the_other_goes_on():
    done = []

    def run(step, shared, line):
        if step == ("full",):
            raise OSError(errno.ENOSPC, "No space left on device", "results/metrics.csv")
        done.append(step)

    with pytest.raises(
        SystemExit, match="^no space left on the disk for results/metrics.csv. What was written"
    ):
        run_side_by_side([[("full",), ("after",)], [("other",)]], [], 1, run)
    assert done == [("other",)]


def test_a_step_that_failed_can_be_given_again(tmp_path, monkeypatch):
    monkeypatch.setattr("tstar_rl.launch.side_by_side.run_child", lambda *arguments: 1)
    with pytest.raises(SystemExit) as end:
        run_recipe(("plot", "terminal_reward={score: terminal, baseline: none}"))
    told = shlex.split(str(end.value).removeprefix("this step failed: "))
    assert told[1:] == [str(RECIPES / "plot.py"), "terminal_reward={score: terminal, baseline: none}"]
