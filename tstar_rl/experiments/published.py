"""Publishing: the tables of finished runs, copied to where the page reads them."""

import shutil
from collections.abc import Callable
from pathlib import Path

from tstar_rl.checks import InvalidValueError, UserError
from tstar_rl.runs.csv_tables import LogError, read_table
from tstar_rl.runs.files import replacing, turn_to_write
from tstar_rl.runs.run_config import DamagedConfigError, read_config
from tstar_rl.runs.run_folder import Place, is_untrained, read_run_path

__all__ = ["publish"]

TABLES = ("config.yaml", "metrics.csv", "calibration.csv", "evaluation.csv")
"""In the order in which they are copied: what has the last one is whole."""
SPENT = "env_steps"
"""The column of an evaluation that is empty until the training has ended."""
MEASURED = "minutes"
"""The column that two runs of the same numbers differ in."""


def publish(
    source: str | Path, target: str | Path, chosen: Callable[[Place], bool] = lambda run: True
) -> list[Path]:
    """Copies the tables of every finished run below `source` to the same place below `target`.

    A run that lies there already is left as it is: where skills were made anew, their first tables stay. One that was
    evaluated while it was trained is not finished.

    Args:
        source: folder of results.
        target: folder of published results.
        chosen: whether a run is to be published; others, as of a seed for tuning, stay where they are.

    Returns:
        The files written.

    Raises:
        InvalidValueError: a run was published before with other figures; the others are copied first, but for chains of
            skills with other figures than those that are published. Or a table lies in no run's folder.
        LogError: a table of a run is damaged. Here too, and for a table of no run, the others are copied first.
    """
    written, differ = [], []
    other_skills: set[tuple[str, str, int]] = set()
    found, damaged = _skills_first(Path(source), Path(target), chosen)
    for file, there in found:
        place = read_run_path(there.parent.relative_to(target))[0]
        with turn_to_write(there.parent):
            try:
                tables = _whole_tables(file.parent)
                if there.is_file():
                    if not _has_figures_of(there, file):
                        differ.append(there)
                        if place.subtask is not None:
                            other_skills.add((place.task, place.system, place.seed))
                elif place.subtask is None and _skills_of(file.parent, place) in other_skills:
                    differ.append(there)
                elif tables:
                    written += _copy(tables, there.parent)
            except (LogError, DamagedConfigError) as error:
                damaged.append(error)
    if differ:
        raise InvalidValueError(
            f"published before with other figures than those in {source}, or of skills that were: "
            f"{', '.join(map(str, differ))}; delete these folders, with all that came of these skills, if the new runs "
            "are to replace them"
        )
    if damaged:
        raise damaged[0]
    return written


def _skills_first(
    source: Path, target: Path, chosen: Callable[[Place], bool]
) -> tuple[list[tuple[Path, Path]], list[UserError]]:
    """Evaluations of chosen runs, with where they are published, skills first; and errors of those of no run."""
    found: list[tuple[bool, Path, Path]] = []
    errors: list[UserError] = []
    for file in sorted(source.rglob("evaluation.csv")):
        try:
            place, below = read_run_path(file.parent.relative_to(source), source)
        except InvalidValueError as error:
            errors.append(error)
            continue
        # Below a run's folder lies what was evaluated by its path, as one skill of a chain.
        if chosen(place) and below == Path():
            found.append((place.subtask is None, file, target / file.relative_to(source)))
    return [(file, there) for _, file, there in sorted(found)], errors


def _skills_of(run: Path, place: Place) -> tuple[str, str | None, int]:
    """Task, system and seed of the skills that a chain was made of; no system of one policy for the whole task."""
    config = read_config(run)
    chained = "from_checkpoint" in config or is_untrained(place.system)
    return place.task, config.get("skills") if chained else None, place.seed


def _whole_tables(run: Path) -> list[Path]:
    """The tables of a finished run, none of another; raises LogError for one that is damaged."""
    tables = [run / name for name in TABLES if (run / name).is_file()]
    read = {table.name: read_table(table) for table in tables if table.suffix == ".csv"}
    spent = read["evaluation.csv"].get(SPENT)
    return tables if spent is None or spent.notna().all() else []


def _copy(tables: list[Path], place: Path) -> list[Path]:
    """Copies tables; returns where they lie then."""
    for table in tables:
        with replacing(place / table.name) as partial:
            shutil.copyfile(table, partial)
    return [place / table.name for table in tables]


def _has_figures_of(published: Path, file: Path) -> bool:
    """Whether two evaluations are the same but for minutes and the order of rows; a published one may be damaged."""
    try:
        there, here = (read_table(each).drop(columns=MEASURED, errors="ignore") for each in (published, file))
    except LogError:
        return False
    return sorted(there.to_csv(index=False).splitlines()) == sorted(here.to_csv(index=False).splitlines())
