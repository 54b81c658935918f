"""Damages copies of a checkpoint in every way, and loads each: none may be read with other weights.

    python tools/damage_checkpoints.py                                  # 1,000 copies of a small skill
    python tools/damage_checkpoints.py --copies 200 runs/table_lack/gail_ppo/seed0/subtask0/last

A byte is flipped, a file is cut short, deleted, added, or swapped with the same file of another checkpoint. Prints a
table of what became of the copies, by kind of damage; exits with 1 unless all were refused by the name of the file.
"""

import argparse
import random
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import torch

from tstar_rl.chaining.skill import Skill
from tstar_rl.models.network_settings import NetworkSettings
from tstar_rl.runs.checksums import DamagedCheckpointError

REFUSED, UNNAMED, LOADED = "refused by name", "refused otherwise", "loaded"


def flip(file: Path, other: Path, draw: random.Random) -> None:
    """Changes one byte."""
    content = bytearray(file.read_bytes())
    place = draw.randrange(len(content))
    content[place] ^= draw.randrange(1, 256)
    file.write_bytes(content)


def cut(file: Path, other: Path, draw: random.Random) -> None:
    """Keeps the first bytes."""
    content = file.read_bytes()
    file.write_bytes(content[: draw.randrange(len(content))])


def swap(file: Path, other: Path, draw: random.Random) -> None:
    """Puts the other checkpoint's file in its place."""
    shutil.copyfile(other, file)


def delete(file: Path, other: Path, draw: random.Random) -> None:
    """Removes it."""
    file.unlink()


def add(file: Path, other: Path, draw: random.Random) -> None:
    """Puts a file beside it that was not saved."""
    (file.parent / "state.pt").write_bytes(file.read_bytes())


KINDS = {"flipped": flip, "cut short": cut, "swapped": swap, "deleted": delete, "added": add}


def damaged_copies(
    whole: Path, other: Path, copies: int, folder: Path, seed: int = 0
) -> Iterator[tuple[str, str, Path]]:
    """Kind of damage, name of the file and folder of each copy; a copy is gone when the next one is made.

    Args:
        whole: a checkpoint.
        other: another one with files of the same names.
        copies: how many, the kinds in turn, the files at random.
        folder: where they lie.
        seed: of files and damage.
    """
    draw = random.Random(seed)
    names = sorted(path.relative_to(whole).as_posix() for path in whole.rglob("*") if path.is_file())
    differ = [name for name in names if (whole / name).read_bytes() != (other / name).read_bytes()]
    for number in range(copies):
        kind = list(KINDS)[number % len(KINDS)]
        name = draw.choice(differ if kind == "swapped" else names)
        copy = folder / "copy"
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(whole, copy)
        KINDS[kind](copy / name, other / name, draw)
        yield kind, (Path(name).parent / "state.pt").as_posix() if kind == "added" else name, copy


def outcome(copy: Path, name: str, load: Callable[[Path], Any] = Skill.load) -> str:
    """What loading a copy, of which the file `name` is damaged, came to."""
    try:
        load(copy)
    except DamagedCheckpointError as error:
        return REFUSED if name in str(error) else UNNAMED
    except Exception:
        return UNNAMED
    return LOADED


def small_skill(path: Path, seed: int) -> None:
    """Saves a skill with random weights."""
    torch.manual_seed(seed)
    Skill("table_lack", 0, NetworkSettings(hidden=(16,), discriminator_hidden=(16,))).save(path)


def main() -> int:
    """Counts and prints."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("checkpoint", type=Path, nargs="?", help="of a skill; by default a small one is made")
    parser.add_argument("--copies", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        small_skill(folder / "whole", 1)
        whole, other = given.checkpoint or folder / "whole", folder / "other"
        if given.checkpoint is None:
            small_skill(other, 2)
        else:  # the same skill with other weights
            skill = Skill.load(whole)
            skill.policy.apply(lambda part: [p.data.add_(1.0) for p in part.parameters(recurse=False)])
            skill.save(other)
        counted = Counter(
            (kind, outcome(copy, name))
            for kind, name, copy in damaged_copies(whole, other, given.copies, folder, given.seed)
        )
    print(f"{'':>10}", *(f"{result:>18}" for result in (REFUSED, UNNAMED, LOADED)))
    for kind in KINDS:
        print(f"{kind:>10}", *(f"{counted[kind, result]:>18}" for result in (REFUSED, UNNAMED, LOADED)))
    return int(sum(counted[kind, REFUSED] for kind in KINDS) != given.copies)


if __name__ == "__main__":
    sys.exit(main())
