"""CSV tables that outlive a process killed at any moment: rows are added at the end, anything else is done at once."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

__all__ = ["MetricsLog", "append_rows"]


class MetricsLog:
    """A CSV file that grows by rows.

    Args:
        path: of the file. What is there is kept until `truncate`.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.columns: list[str] = []
        self.rows = 0

    def append(self, row: Mapping[str, Any]) -> None:
        """Adds one row and flushes it to disk. A name that is new becomes a column, empty in the rows before."""
        new = [name for name in row if name not in self.columns]
        if new and self.rows:
            table = pd.read_csv(self.path, dtype=str, keep_default_na=False)
            _replace(self.path, table.assign(**dict.fromkeys(new, "")).to_csv(index=False))
        self.columns += new
        frame = pd.DataFrame([row], columns=self.columns)
        frame.to_csv(self.path, mode="a" if self.rows else "w", header=not self.rows, index=False)
        self.rows += 1

    def truncate(self, rows: int) -> None:
        """Keeps the first `rows` rows; the columns are those of the file."""
        if rows == 0:
            self.path.unlink(missing_ok=True)
            self.columns, self.rows = [], 0
            return
        lines = self.path.read_text().splitlines(keepends=True)
        if len(lines) < rows + 1:
            raise ValueError(f"{self.path} has {len(lines) - 1} rows, but its checkpoint counts {rows}")
        _replace(self.path, "".join(lines[: rows + 1]))
        self.columns, self.rows = lines[0].strip().split(","), rows


def append_rows(path: str | Path, rows: list[dict[str, Any]], key: tuple[str, ...]) -> pd.DataFrame:
    """Writes rows into a CSV table, in the place of rows with the same values of `key`; returns the table."""
    path, new = Path(path), pd.DataFrame(rows)
    if path.is_file():
        old = pd.read_csv(path)
        same = old.set_index(list(key)).index.isin(new.set_index(list(key)).index)
        new = pd.concat([old[~same], new], ignore_index=True) if not same.all() else new
    path.parent.mkdir(parents=True, exist_ok=True)
    _replace(path, new.to_csv(index=False))
    return new


def _replace(path: Path, text: str) -> None:
    """Writes a file at once: a process that is killed leaves the old text or the new one."""
    partial = path.with_name(path.name + ".partial")
    partial.write_text(text)
    os.replace(partial, path)
