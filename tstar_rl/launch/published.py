"""Publishing: the tables of finished runs, copied to where the page reads them."""

import shutil
from pathlib import Path

import pandas as pd

from tstar_rl.checks import InvalidValueError
from tstar_rl.runs.files import replacing, turn_to_write

__all__ = ["publish"]

TABLES = ("config.yaml", "metrics.csv", "calibration.csv", "evaluation.csv")
"""In the order in which they are copied: what has the last one is whole."""
MEASURED = "minutes"
"""The column that two runs of the same numbers differ in."""


def publish(source: str | Path, target: str | Path) -> list[Path]:
    """Copies the tables of every finished run below `source` to the same place below `target`.

    A run that lies there already is left as it is: where skills were made anew, their first tables stay.

    Returns:
        The files written.

    Raises:
        InvalidValueError: a run was published before with other figures; the others are copied first.
    """
    written, differ = [], []
    for file in sorted(Path(source).rglob("evaluation.csv")):
        there = Path(target) / file.relative_to(source)
        with turn_to_write(there.parent):
            if there.is_file():
                differ += [there] if _figures(there) != _figures(file) else []
            else:
                written += _copy(file.parent, there.parent)
    if differ:
        raise InvalidValueError(
            f"published before with other figures than those in {source}: {', '.join(map(str, differ))}; "
            "delete these folders if the new runs are to replace them"
        )
    return written


def _copy(run: Path, place: Path) -> list[Path]:
    """Copies the tables that a run has; returns where they lie then."""
    tables = [name for name in TABLES if (run / name).is_file()]
    for name in tables:
        with replacing(place / name) as partial:
            shutil.copyfile(run / name, partial)
    return [place / name for name in tables]


def _figures(file: Path) -> str:
    """An evaluation without the minutes that it took; of a file that is no table, nothing."""
    try:
        return pd.read_csv(file).drop(columns=MEASURED, errors="ignore").to_csv(index=False)
    except (pd.errors.EmptyDataError, pd.errors.ParserError):
        return ""
