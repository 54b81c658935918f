"""Publishing: the tables of finished runs, copied to where the page reads them."""

import shutil
from collections.abc import Callable
from pathlib import Path

from tstar_rl.checks import InvalidValueError
from tstar_rl.runs.csv_tables import LogError, read_table
from tstar_rl.runs.files import replacing, turn_to_write
from tstar_rl.runs.run_folder import Place, read_run_path

__all__ = ["publish"]

TABLES = ("config.yaml", "metrics.csv", "calibration.csv", "evaluation.csv")
"""In the order in which they are copied: what has the last one is whole."""
MEASURED = "minutes"
"""The column that two runs of the same numbers differ in."""


def publish(
    source: str | Path, target: str | Path, declared: Callable[[Place], bool] = lambda run: True
) -> list[Path]:
    """Copies the tables of every finished run below `source` to the same place below `target`.

    A run that lies there already is left as it is: where skills were made anew, their first tables stay.

    Args:
        source: folder of results.
        target: folder of published results.
        declared: whether a run is of the experiment. One that is not, as of a seed for tuning, stays where it is.

    Returns:
        The files written.

    Raises:
        InvalidValueError: a run was published before with other figures; the others are copied first.
        LogError: a table of a run is damaged; the others are copied first.
    """
    written, differ, damaged = [], [], []
    for file in sorted(Path(source).rglob("evaluation.csv")):
        run = file.relative_to(source).parent
        if not declared(read_run_path(run)[0]):
            continue
        there = Path(target) / run / file.name
        with turn_to_write(there.parent):
            try:
                tables = _whole_tables(file.parent)
                if there.is_file():
                    differ += [] if _has_figures_of(there, file) else [there]
                else:
                    written += _copy(tables, there.parent)
            except LogError as error:
                damaged.append(error)
    if differ:
        raise InvalidValueError(
            f"published before with other figures than those in {source}: {', '.join(map(str, differ))}; "
            "delete these folders if the new runs are to replace them"
        )
    if damaged:
        raise damaged[0]
    return written


def _whole_tables(run: Path) -> list[Path]:
    """The tables that a run has; raises LogError for one that is damaged."""
    tables = [run / name for name in TABLES if (run / name).is_file()]
    for table in tables:
        if table.suffix == ".csv":
            read_table(table)
    return tables


def _copy(tables: list[Path], place: Path) -> list[Path]:
    """Copies tables; returns where they lie then."""
    for table in tables:
        with replacing(place / table.name) as partial:
            shutil.copyfile(table, partial)
    return [place / table.name for table in tables]


def _has_figures_of(published: Path, file: Path) -> bool:
    """Whether two evaluations are the same but for the minutes that they took; a published one may be damaged."""
    try:
        there, here = (read_table(each).drop(columns=MEASURED, errors="ignore") for each in (published, file))
    except LogError:
        return False
    return there.to_csv(index=False) == here.to_csv(index=False)
