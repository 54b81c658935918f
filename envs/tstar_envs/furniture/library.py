"""Which pieces of furniture there are: the package's own, in `data/*.yaml`, and those in folders of the user's."""

from __future__ import annotations

import functools
import hashlib
import json
import os
import re
from collections.abc import Iterable
from pathlib import Path

from tstar_envs.checks import short
from tstar_envs.furniture.errors import FurnitureError, did_you_mean
from tstar_envs.furniture.reading import read_file
from tstar_envs.furniture.schema import Furniture

DATA = Path(__file__).parent / "data"
FURTHER = "TSTAR_FURNITURE"
"""Environment variable: folders with further pieces, separated as in PATH. Other processes are told with it."""
_NAME = re.compile(r"[a-z0-9]+(_[a-z0-9]+)*")


def names(folders: Iterable[Path] | None = None) -> tuple[str, ...]:
    """Returns the names that `load` knows: of files whose name is words of small letters and digits, joined by `_`.

    Args:
        folders: that are looked into; None: the package's own and those of `FURTHER`.

    Raises:
        FurnitureError: `FURTHER` names what is no folder.
    """
    places = _folders() if folders is None else folders
    found = {path.stem for folder in places for path in folder.glob("*.yaml") if path.is_file()}
    return tuple(sorted(filter(is_name, found)))


def _folders() -> list[Path]:
    """The package's own, and those that the user has named, which must be there."""
    own, *further = _named_folders()
    for folder in further:
        if not folder.is_dir():
            raise FurnitureError(
                f"{FURTHER} names {folder}, which is no folder; it names folders of furniture files"
            )
    return [own, *further]


def _named_folders() -> list[Path]:
    further = [Path(one).expanduser() for one in os.environ.get(FURTHER, "").split(os.pathsep) if one]
    return list({folder.resolve(): folder for folder in (DATA, *further)}.values())


def files(name: str) -> list[Path]:
    """Returns the files of pieces called `name`; `load` refuses two."""
    return [file for folder in _named_folders() if (file := folder / f"{name}.yaml").is_file()]


def camel_case(name: str) -> str:
    """Returns a name as Gymnasium's ids have it: `table_lack` is `TableLack`."""
    return "".join(word.capitalize() for word in name.split("_"))


def is_name(name: str) -> bool:
    """Whether a piece of the library may be called `name`."""
    return _NAME.fullmatch(name) is not None


def load(name: str) -> Furniture:
    """Returns the piece of furniture called `name`.

    Raises:
        FurnitureError: no file of that name, or a field of it is wrong.
        OSError: its file cannot be read.
    """
    if not isinstance(name, str):
        raise FurnitureError(
            f"furniture is called by a name, got {short(name)}: valid: {', '.join(map(repr, names()))}"
        )
    return _load(name)[0]


def digest(name: str) -> str:
    """What the file of a piece says, as 64 hexadecimal digits of SHA-256.

    Two files that differ in comments alone, or in the order of keys, have one digest, even where these are the parts,
    whose order is that of an observation. It is of the file as `load` read it, so of the piece that is simulated,
    whatever the file says by now.

    Raises:
        FurnitureError: as `load`.
    """
    load(name)
    return _load(name)[1]


@functools.cache
def _load(name: str) -> tuple[Furniture, str]:
    """The piece and its digest, of one reading of the file."""
    # The package's own are there whatever FURTHER names.
    if name not in names((DATA,)) and name not in names():
        raise FurnitureError(
            f"no furniture is called {name!r}: {did_you_mean(name, names())}; {FURTHER}, which names folders with "
            f"others, is {os.environ.get(FURTHER) or 'not set'}"
        )
    first, *others = files(name)
    if others:
        raise FurnitureError(
            f"two pieces are called {name!r}: {first} and {others[0]}; rename one of the files"
        )
    furniture, said = read_file(first)
    return furniture, hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()


def read(path: Path) -> Furniture:
    """Reads and checks one furniture file (its schema: `data/table_lack.yaml`, with comments).

    Raises:
        FurnitureError: it is no YAML in UTF-8, or says something that cannot be.
        OSError: it cannot be read.
    """
    return read_file(path)[0]
