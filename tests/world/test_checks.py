"""What a message shows of a value is short, whatever the value is."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tstar_envs.checks import short

ROOT = Path(__file__).resolve().parents[2]
ENVIRON = {**os.environ, "PYTHONPATH": str(ROOT / "envs")}


def nested(levels: int) -> str:
    """A file of YAML in which each line has the one before nine times: 9**levels items in all."""
    lines = ["a0: &a0 [1, 1]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, levels)]
    return "\n".join([*lines, f"parts: *a{levels - 1}"]) + "\n"


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (3, "3"),
        ("a" * 20, repr("a" * 20)),
        ([1, [2, 3]], "[1, [2, 3]]"),
    ],
)
def test_what_is_short_is_shown_as_it_is(value, shown):
    assert short(value) == shown


def test_a_number_that_python_does_not_print_is_told_as_one():
    assert short(10**5000) == "a very long number"


def test_a_file_that_holds_more_than_memory_does_is_refused_at_once(tmp_path):
    """Printed whole its message would take longer than the universe lasts: so it is read in a process of its own."""
    (tmp_path / "bomb.yaml").write_text(nested(30))
    script = "import sys, pathlib, tstar_envs.furniture.library as it; it.read(pathlib.Path(sys.argv[1]))"
    command = [sys.executable, "-c", script, str(tmp_path / "bomb.yaml")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, env=ENVIRON)
    assert "FurnitureError: bomb.yaml: " in done.stderr and len(done.stderr) < 4000
