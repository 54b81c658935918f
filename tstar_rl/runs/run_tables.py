"""The tables that a run writes row by row, and how many of their rows a checkpoint counts."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tstar_rl.runs.csv_tables import MetricsLog
from tstar_rl.runs.files import flush

__all__ = ["RunTables"]


class RunTables:
    """metrics.csv, terminal_states.csv and calibration.csv in `results`, timing.csv in `work`.

    Each begins with env_steps, the environment steps at which a row was written.
    """

    def __init__(self, results: Path, work: Path) -> None:
        self.metrics = MetricsLog(results / "metrics.csv", "env_steps")
        self.terminal_states = MetricsLog(results / "terminal_states.csv", "env_steps")
        self.calibration = MetricsLog(results / "calibration.csv", "env_steps")
        self.timing = MetricsLog(work / "timing.csv", "env_steps")

    def state_dict(self) -> dict[str, int]:
        """How many rows each has."""
        return {name: log.rows for name, log in vars(self).items()}

    def check(self, state: Mapping[str, Any]) -> None:
        """Raises a LogError if a table has lost rows that `state_dict` counted."""
        for name, log in vars(self).items():
            log.check(_rows(state, name))

    def clear(self) -> None:
        """Drops all rows."""
        for log in vars(self).values():
            log.truncate(0)

    def truncate(self, state: Mapping[str, Any]) -> None:
        """Drops the rows that were written since `state_dict` gave this."""
        for name, log in vars(self).items():
            log.truncate(_rows(state, name))

    def flush(self) -> None:
        """Has the tables on the disk before what counts their rows: a machine that loses its power loses neither."""
        written = [path for log in vars(self).values() if (path := log.path).is_file()]
        flush(*written, *{path.parent for path in written})


def _rows(state: Mapping[str, Any], name: str) -> int:
    """0 where an older version did not have the table."""
    return int(state.get(name, 0))
