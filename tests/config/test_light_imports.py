"""What takes no torch does not wait for it: help, mistakes on the command line, and a recipe's own imports."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from recipe_runs import command, environ

HEAVY = "print(*sorted({'torch', 'mujoco', 'pandas'} & set(sys.modules)), file=sys.stderr)"
"""The line of a script that says what it has imported."""
LIGHT = sorted(
    path.stem
    for path in Path(command("bc")[1]).parent.glob("*.py")
    if re.search("^import tstar_rl as rl$", text := path.read_text(), re.MULTILINE) and "@rl.recipe(" in text
)
"""Recipes that say `import tstar_rl as rl`."""


def imported(script: str, folder: Path) -> str:
    called = [sys.executable, "-c", f"import runpy, sys\n{script}\n{HEAVY}"]
    done = subprocess.run(called, env=environ(), cwd=folder, capture_output=True, text=True, check=True)
    return done.stderr


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("gail_ppo", ["--help"]),
        ("gail_ppo", ["seed=-1"]),
        ("gail_ppo", ["popo.epochs=1"]),
        ("feasibility", ["label=successes"]),
    ],
)
def test_an_answer_does_not_wait_for_torch(name, values, tmp_path):
    recipe, *values = command(name, *values)[1:]
    script = f"sys.argv = {[recipe, *values]!r}\n"
    script += "try: runpy.run_path(sys.argv[0], run_name='__main__')\n"
    assert imported(f"{script}except SystemExit: pass", tmp_path) == "\n"


def test_a_recipe_loads_nothing_before_its_main(tmp_path):
    assert {"bc", "tstar", "in_order_cloned"} <= set(LIGHT)
    paths = [command(name)[1] for name in LIGHT]
    assert imported(f"for path in {paths!r}: runpy.run_path(path)", tmp_path) == "\n"


def test_what_starts_other_recipes_does_not_wait_for_torch(tmp_path):
    paths = [command(name)[1] for name in ("assemble", "baselines", "experiment")]
    assert imported(f"for path in {paths!r}: runpy.run_path(path)", tmp_path) == "pandas\n"
