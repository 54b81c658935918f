"""Kills recipes at random moments (-9), starts them again, and compares what they leave with runs that nobody killed.

    python tools/kill_and_resume.py --kills 100                 # a training, a chain, evaluations, ... in turn
    python tools/kill_and_resume.py --kills 3 --only chain

All of it at a tiny scale, whose clones succeed: so states are handed over, and terminal states are kept. First
`assemble` runs through: its tables, demonstrations and skills are what is compared with, and what the other recipes
start from. One that it does not run is run through by itself. Then each recipe is killed with all its processes and
started again, until it is done; that repeats until it has had its share of the kills. What it leaves is compared as
`same_files.py` says. Prints a table; exits with 1 if any start failed or anything differs.
"""

import argparse
import logging
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
from same_files import differing

ROOT = Path(__file__).resolve().parents[1]
TASK = ("demonstrations", "runs", "results")
TINY = [
    "scale=quick", "progress_bar=false", "demonstrations.episodes=48", "demonstrations.num_envs=16", "bc.epochs=150",
    "training.num_envs=8", "training.horizon=16", "training.total_steps=1024", "training.checkpoint_every=256",
    "ppo.minibatch=64", "chain.rounds=1", "chain.steps_per_turn=1024", "chain.trial_episodes=8",
    "chain.seed_episodes=8", "evaluation.episodes=8", "evaluation.whole_episodes=8", "evaluation.recorded=0",
]  # fmt: skip


@dataclass(frozen=True)
class Subject:
    """A recipe that is killed.

    Attributes:
        command: its name and values.
        needs: folders of a finished pipeline that it starts from.
        leaves: what it writes, as patterns of files below the folders.
    """

    command: tuple[str, ...]
    needs: tuple[str, ...]
    leaves: tuple[str, ...]


SUBJECTS = {
    "training": Subject(
        ("gail_ppo", "subtask=0"),
        ("demonstrations",),
        ("results/*/gail_ppo/seed0/subtask0/metrics.csv", "runs/*/gail_ppo/seed0/subtask0/last"),
    ),
    "chain": Subject(
        ("tstar",),
        ("demonstrations", "runs/*/gail_ppo"),
        (
            "results/*/tstar/seed0/metrics.csv",
            "results/*/tstar/seed0/terminal_states.csv",
            "runs/*/tstar/seed0/*/skill*",
        ),
    ),
    "signal": Subject(
        ("feasibility",),
        ("demonstrations", "runs/*/gail_ppo"),
        ("results/*/feasibility/seed0/*.csv", "runs/*/feasibility/seed0/*/skill*"),
    ),
    "evaluation": Subject(("evaluate", "system=tstar"), ("runs",), ("results/*/tstar/seed0/evaluation.csv",)),
    "demonstrations": Subject(
        ("make_demonstrations", "subtask=0", "kinds=[noisy]"), (), ("demonstrations/*/*/subtask0_noisy.npz",)
    ),
    "assemble": Subject(
        ("assemble", "processes=1"),
        (),
        # Below the task: results/assemble.csv has the minutes of a pipeline that nobody interrupted.
        ("results/*/**/*.csv", "demonstrations/*/*/*.npz", "runs/**/last", "runs/**/best", "runs/**/skill*"),
    ),
}


def start(subject: Subject, folder: Path, errors: Path) -> subprocess.Popen[bytes]:
    """Starts a recipe, in a process group of its own."""
    name, *values = subject.command
    places = [f"{kind}_dir={folder / kind}" for kind in TASK]
    environ = {**os.environ, "PYTHONPATH": f"{ROOT}:{ROOT / 'envs'}", "OMP_NUM_THREADS": "1"}
    command = [sys.executable, str(ROOT / "recipes" / f"{name}.py"), *TINY, *values, *places]
    with errors.open("wb") as file:
        return subprocess.Popen(
            command, env=environ, stdout=subprocess.DEVNULL, stderr=file, start_new_session=True
        )


def prepare(subject: Subject, whole: Path, folder: Path) -> None:
    """Copies what a recipe starts from into an empty folder."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for pattern in subject.needs:
        for found in whole.glob(pattern):
            shutil.copytree(found, folder / found.relative_to(whole))


def untouched(subject: Subject, whole: Path, folder: Path) -> float:
    """The seconds that a recipe takes if nobody kills it.

    Raises:
        SystemExit: if it fails.
    """
    prepare(subject, whole, folder)
    began = time.perf_counter()
    if start(subject, folder, folder.with_suffix(".err")).wait():
        raise SystemExit(folder.with_suffix(".err").read_text())
    return time.perf_counter() - began


def compared_with(subject: Subject, folder: Path, whole: Path) -> Path:
    """What a killed recipe is compared with: `whole`, or, if `assemble` does not run it, what it has left in `folder`.

    That is put beside `folder`, not into `whole`: there `assemble` itself would lack it.
    """
    if any(any(whole.glob(pattern)) for pattern in subject.leaves):
        return whole
    place = folder.with_suffix(".whole")
    shutil.rmtree(place, ignore_errors=True)
    return Path(shutil.copytree(folder, place))


@dataclass
class Count:
    """What became of a recipe."""

    kills: int = 0
    completed: int = 0
    failed: int = 0
    different: int = 0


def torment(
    subject: Subject,
    whole: Path,
    folder: Path,
    kills: int,
    seconds: float,
    draw: random.Random,
    compared: Path | None = None,
) -> Count:
    """Kills and resumes a recipe `kills` times, and compares what it leaves each time that it is done.

    Args:
        subject: the recipe.
        whole: what nobody killed has left.
        folder: where it runs.
        kills: how many.
        seconds: that it takes; each kill comes at a random moment within them.
        draw: of the moments.
        compared: what its files are compared with; None: `whole`.
    """
    count, errors = Count(), folder.with_suffix(".err")
    prepare(subject, whole, folder)
    while True:
        process = start(subject, folder, errors)
        moment = draw.uniform(0, seconds) if count.kills < kills else None
        try:
            code = process.wait(moment)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            count.kills += 1
            print(f"  killed after {moment:.1f} s")
            continue
        if code:
            count.failed += 1
            print(f"  FAILED: {errors.read_text()[-2000:]}")
            return count
        wrong = differing(subject.leaves, compared or whole, folder)
        count.completed, count.different = count.completed + 1, count.different + bool(wrong)
        print(f"  done; {'differs: ' + ', '.join(wrong) if wrong else 'the same'}")
        if count.kills >= kills:
            return count
        prepare(subject, whole, folder)


def main() -> int:
    """Runs through once, then kills."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=100, help="in all")
    parser.add_argument("--only", choices=SUBJECTS, nargs="+", default=list(SUBJECTS))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--keep", type=Path, help="keep the runs in this folder; a whole run there is used again"
    )
    given = parser.parse_args()
    sys.stdout.reconfigure(line_buffering=True)
    logging.getLogger("torchrl").setLevel(logging.WARNING)  # else: a line for each skill compared
    draw, counts = random.Random(given.seed), {}
    with tempfile.TemporaryDirectory() as scratch:
        folder = given.keep or Path(scratch)
        whole = folder / "whole"
        folder.mkdir(parents=True, exist_ok=True)
        if not (folder / "whole.done").exists():
            (folder / "whole.done").write_text(str(untouched(SUBJECTS["assemble"], whole, whole)))
        for number, name in enumerate(given.only):
            share = given.kills // len(given.only) + (number < given.kills % len(given.only))
            subject, place, compared = SUBJECTS[name], folder / name, whole
            if name == "assemble":
                seconds = float((folder / "whole.done").read_text())
            else:
                seconds = untouched(subject, whole, place)
                compared = compared_with(subject, place, whole)
            print(f"{name}, {seconds:.0f} s, {share} kills")
            counts[name] = torment(subject, whole, place, share, seconds, draw, compared)
    table = pd.DataFrame({name: vars(count) for name, count in counts.items()}).T
    print(table.to_string())
    return int(table[["failed", "different"]].to_numpy().any())


if __name__ == "__main__":
    sys.exit(main())
