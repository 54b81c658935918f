"""Reading results loads no learning library and leaves Matplotlib's state alone."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = """
import pkgutil, sys
import matplotlib
settings = matplotlib.rcParams
before = {name: settings._get(name) for name in settings}  # reading the backend itself would choose one
import tstar_rl.analysis
for module in pkgutil.walk_packages(tstar_rl.analysis.__path__, "tstar_rl.analysis."):
    __import__(module.name)
found = [name for name in ("torch", "torchrl", "tensordict", "hydra", "matplotlib.pyplot") if name in sys.modules]
changed = [name for name, value in before.items() if settings._get(name) != value]
print(found, changed, sum(name.startswith("tstar_rl.analysis") for name in sys.modules))
"""


def test_the_whole_room_is_imported_without_torch_and_without_pyplot():
    environ = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "envs")])}
    command = [sys.executable, "-c", SCRIPT]
    done = subprocess.run(command, env=environ, capture_output=True, text=True, check=True)
    found, changed, modules = done.stdout.rsplit(maxsplit=2)
    files = list((ROOT / "tstar_rl" / "analysis").rglob("*.py"))
    assert (found, changed) == ("[]", "[]") and int(modules) == len(files)
