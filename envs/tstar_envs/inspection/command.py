"""`python -m tstar_envs.furniture`: checks a piece of furniture, draws it, and tries the scripted assembler on it.

python -m tstar_envs.furniture check my_stool.yaml        # findings, my_stool.png, and the script on each step
python -m tstar_envs.furniture check table_lack           # a piece of the library by its name
python -m tstar_envs.furniture draw table_lack lack.png   # a small picture alone
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from tstar_envs.furniture import Furniture, FurnitureError, library
from tstar_envs.inspection import drawing
from tstar_envs.inspection.findings import inspect
from tstar_envs.inspection.trial import try_out
from tstar_envs.tasks.episode_start import StartError

SUFFIXES = (".yaml", ".yml")
"""By which a file is told from the name of a piece."""
ENOUGH, ENOUGH_WHOLE = 0.95, 0.85
"""Share of scripted episodes of a step, and of the whole piece, with which a piece is fit for the library."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line; returns 0, or 1 where something is wrong or the script does not do the piece."""
    asked = _parser().parse_args(arguments)
    try:
        furniture = _read(asked.file)
        if asked.command == "draw":
            return _draw(furniture, asked.picture, small=True)
        return _check(furniture, asked)
    except (FurnitureError, StartError, OSError) as error:
        print(f"WRONG     {error}")
        return 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m tstar_envs.furniture", description=(__doc__ or "").split("\n")[0]
    )
    commands = parser.add_subparsers(dest="command", required=True)
    check = commands.add_parser(
        "check", help="say what is wrong or doubtful, draw the piece, try the script on it"
    )
    check.add_argument("file", help="a furniture file, or the name of a piece in the library")
    check.add_argument("--picture", type=_png, help="where the PNG goes; by default beside you, <name>.png")
    check.add_argument("--episodes", type=_number, default=20, help="scripted episodes of each step; 0: none")
    draw = commands.add_parser("draw", help="a small picture: the start and the assembled piece")
    draw.add_argument("file")
    draw.add_argument("picture", type=_png)
    return parser


def _png(name: str) -> Path:
    if Path(name).suffix.lower() != ".png":
        raise argparse.ArgumentTypeError(f"a picture is a file that ends in .png, got {name!r}")
    return Path(name)


def _number(text: str) -> int:
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"must be a whole number from 0, got {text!r}")
    return int(text)


def _read(file: str) -> Furniture:
    if not file.endswith(SUFFIXES):
        return library.load(file)
    if not Path(file).is_file():
        raise FurnitureError(f"{file}: there is no such file")
    return library.read(Path(file))


def _check(furniture: Furniture, asked: argparse.Namespace) -> int:
    parts, steps = len(furniture.parts), len(furniture.steps)
    print(f"{furniture.name}: {parts} parts, {steps} steps")
    file = Path(asked.file) if asked.file.endswith(SUFFIXES) else None
    findings = inspect(furniture, file)
    for finding in findings:
        print(finding)
    if not findings:
        print("nothing is wrong or doubtful")
    _draw(furniture, asked.picture or Path(f"{furniture.name}.png"), small=False)
    wrong = any(finding.wrong for finding in findings)
    if asked.episodes > 0:
        wrong |= not _try_out(furniture, asked.episodes)
    return int(wrong)


def _draw(furniture: Furniture, picture: Path, small: bool) -> int:
    drawn = drawing.write(furniture, picture, small)
    print(f"picture: {picture}" if drawn else "nothing is drawn here")
    return int(not drawn)


def _try_out(furniture: Furniture, episodes: int) -> bool:
    """Prints how the scripted assembler does; returns whether it does the piece well enough."""
    print("the scripted assembler:")
    enough = True
    for step in [*range(len(furniture.steps)), None]:
        trial = try_out(furniture, step, episodes)
        least = ENOUGH_WHOLE if step is None else ENOUGH
        enough &= trial.success >= least
        print(f"  {trial}" + ("" if trial.success >= least else f" (a piece of the library: {least:.0%})"))
    return enough
