"""Runs the Python lines of the README with the installed package, from a folder that is not the repository.

    python .ci/library_lines.py README.md <repository>

What only the extras bring is hidden: a user of the wheel has not asked for it.
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

EXTRAS = (
    "ray",
    "warp",
    "mujoco_warp",
    "stable_baselines3",
    "pytest",
    "IPython",
    "nbclient",
    "h5py",
    "minari",
)
HIDE = f"import sys; sys.modules.update(dict.fromkeys({EXTRAS!r})); "
FROM = "import tstar_envs, tstar_rl; print(tstar_envs.__file__, tstar_rl.__file__, sep='\\n')"


def main(readme: Path, repository: Path) -> None:
    """Says what was run; ends with the first block that fails."""
    blocks = re.findall(r"^```python\n(.*?)^```", readme.read_text(), re.MULTILINE | re.DOTALL)
    if not blocks:
        raise SystemExit(f"{readme} has no Python lines to run")
    with tempfile.TemporaryDirectory() as folder:
        found = run(FROM, folder).stdout.splitlines()
        if any(
            Path(file).resolve().is_relative_to(repository.resolve() / room)
            for file in found
            for room in ("envs", "tstar_rl")
        ):
            raise SystemExit(f"these are not the wheel's: {', '.join(found)}")
        print(*found, sep="\n")
        for number, block in enumerate(blocks, 1):
            run(block, folder)
            print(f"README, Python lines {number} of {len(blocks)}: {len(block.splitlines())} run")


def run(code: str, folder: str) -> subprocess.CompletedProcess[str]:
    """Runs Python code in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-I", "-c", HIDE + "\n" + code], cwd=folder, capture_output=True, text=True
    )
    if done.returncode:
        raise SystemExit(f"{code}\n{done.stdout}{done.stderr}")
    return done


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
