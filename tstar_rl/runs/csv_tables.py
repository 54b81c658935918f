"""CSV tables that outlive a process killed at any moment: rows are added at the end, anything else is done at once."""

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from tstar_rl.checks import UserError
from tstar_rl.runs.files import append_text, replacing, turn_to_write

__all__ = ["LogError", "MetricsLog", "append_rows", "check_table", "read_table", "rows_stay", "write_table"]


class LogError(UserError, ValueError):
    """A table of a run is cut off, or has fewer rows than its checkpoint counts."""


def read_table(path: str | Path, columns: Sequence[str] = ()) -> pd.DataFrame:
    """A CSV table as it was written.

    Args:
        path: of the file.
        columns: those that it must have, beside any others.

    Raises:
        LogError: if the file is empty, cut off or no table, or lacks a column; it is named.
        FileNotFoundError: if there is none.
    """
    path = Path(path)
    try:
        text = path.read_text()
        if not text.endswith("\n"):
            raise ValueError("its last line has no end" if text else "it is empty")
        _check_fields(text.split("\n"))  # splitlines() would also split a field that has an odd character
        table = pd.read_csv(StringIO(text), float_precision="round_trip")  # rows that stay are not changed
        if lacking := [name for name in columns if name not in table]:
            raise ValueError(f"it has no column {', '.join(lacking)}")
        return table
    except ValueError as error:  # a UnicodeDecodeError is one, and so are pandas' errors of reading
        raise LogError(
            f"{path} is damaged ({error}): put it back from a copy, or delete it and run what wrote it again"
        ) from error


def _check_fields(lines: Sequence[str]) -> None:
    """Raises a ValueError unless each row has as many fields as there are columns; the first line names these.

    Empty lines are none, as pandas has it.
    """
    lines = [line for line in lines if line.strip("\r\n")]
    if any('"' in line for line in lines):  # a comma may be part of a field
        counts = [len(row) for row in _split(lines)]
    else:
        counts = [line.count(",") + 1 for line in lines]
    for number, count in enumerate(counts):
        if count != counts[0]:
            raise ValueError(f"row {number} has {count} fields, and there are {counts[0]} columns")


def _split(lines: Iterable[str]) -> list[list[str]]:
    """The fields of each line, which may have commas; a ValueError for what cannot be split."""
    try:
        return list(csv.reader(lines))
    except csv.Error as error:  # which is no ValueError
        raise ValueError(str(error)) from error


class MetricsLog:
    """A CSV file that grows by rows.

    Args:
        path: of the file. `truncate` goes on with what is there; without it the first row replaces that.
        first: the name of its first column, by which a file that is something else is told; None: any.
    """

    def __init__(self, path: str | Path, first: str | None = None) -> None:
        self.path, self.first = Path(path), first
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.columns: list[str] = []
        self.rows = 0

    def append(self, row: Mapping[str, Any]) -> None:
        """Adds one row, all of it or nothing. A name that is new becomes a column, empty in the rows before."""
        self.extend([row])

    def extend(self, rows: Iterable[Mapping[str, Any]]) -> None:
        """Adds rows, one after the other, as `append` would; the file is written once."""
        rows = list(rows)
        if not rows:
            return
        named = dict.fromkeys(name for row in rows for name in row)
        new = [name for name in named if name not in self.columns]
        if new and self.rows:
            table = pd.read_csv(self.path, dtype=str, keep_default_na=False)
            _replace(self.path, table.assign(**dict.fromkeys(new, "")).to_csv(index=False))
        columns = self.columns + new
        text = pd.DataFrame(rows, columns=columns, dtype=object).to_csv(index=False, header=not self.rows)
        if self.rows:
            append_text(self.path, text)
        else:
            _replace(self.path, text)
        self.columns, self.rows = columns, self.rows + len(rows)

    def check(self, rows: int) -> None:
        """Raises a LogError if the file has not as many whole rows, or is no table of its columns."""
        self._lines(rows)

    def truncate(self, rows: int) -> None:
        """Keeps the first `rows` rows; the columns are those of the file.

        Raises:
            LogError: see `check`; the file stays unchanged.
        """
        if rows == 0:
            self.path.unlink(missing_ok=True)
            self.columns, self.rows = [], 0
            return
        lines = self._lines(rows)
        _replace(self.path, "".join(lines[: rows + 1]))
        self.columns, self.rows = _split(lines[:1])[0], rows

    def _lines(self, rows: int) -> list[str]:
        """The whole lines of the file, the header and at least `rows`."""
        try:
            text = self.path.read_text() if self.path.is_file() else ""
            lines = re.findall(r"[^\n]*\n", text)  # what has no end was cut off
            if rows and lines and self.first not in (None, *_split(lines[:1])[0][:1]):
                raise ValueError(f"its first column is not {self.first}")
            _check_fields(lines[: rows + 1])
        except ValueError as error:  # a UnicodeDecodeError is one
            raise LogError(f"{self.path} is damaged ({error}): put it back from a copy") from error
        if rows and len(lines) < rows + 1:
            found = f"has {max(len(lines) - 1, 0)} whole rows" if self.path.is_file() else "is missing"
            raise LogError(f"{self.path} {found}, but its checkpoint counts {rows}: put the table back")
        return lines


def write_table(path: str | Path, table: pd.DataFrame) -> None:
    """Writes a CSV table, all of it or nothing, in the place of what is there."""
    _replace(Path(path), table.to_csv(index=False))


def append_rows(path: str | Path, rows: list[dict[str, Any]], key: tuple[str, ...]) -> pd.DataFrame:
    """Writes rows into a CSV table, in the place of rows with the same values of `key`; returns the table.

    Of several processes that do so at once none loses another's rows.
    """
    path, new = Path(path), pd.DataFrame(rows)
    if not rows:
        return read_table(path) if path.is_file() else new
    with turn_to_write(path.parent):
        if path.is_file():
            old = read_table(path)
            same = _have_key_of(old, new, key)
            new = pd.concat([old[~same], new], ignore_index=True) if not same.all() else new
        _replace(path, new.to_csv(index=False))
    return new


def check_table(path: str | Path) -> None:
    """Raises a LogError if a table is there and damaged: asked by a recipe before it measures what goes into it."""
    if Path(path).is_file():
        read_table(path)


def rows_stay(path: str | Path, rows: list[dict[str, Any]], key: tuple[str, ...]) -> bool:
    """Whether `append_rows` with these would leave any row of the table."""
    if not Path(path).is_file():
        return False
    return not rows or not _have_key_of(read_table(path), pd.DataFrame(rows), key).all()


def _have_key_of(old: pd.DataFrame, new: pd.DataFrame, key: tuple[str, ...]) -> NDArray[np.bool_]:
    """(rows of old,) which of them have the key of a new row, once both are read from one file.

    There 0 beside "whole" is "0", and 1 beside 0.5 is 1.0. Where an older file lacks a column of the key, it has none.
    """
    text = pd.concat([old.reindex(columns=list(key)), new[list(key)]]).to_csv(index=False)
    both = pd.MultiIndex.from_frame(pd.read_csv(StringIO(text)))
    return both[: len(old)].isin(both[len(old) :])


def _replace(path: Path, text: str) -> None:
    with replacing(path) as partial:
        partial.write_text(text)
