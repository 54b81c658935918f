"""Which row of a run is the best so far."""

import math
from collections.abc import Mapping
from typing import Any

__all__ = ["BestSoFar"]

FOLLOWED = ("success_rate", "completed")
"""Columns of the metrics whose running means are kept."""
WINDOW = 5
"""Rows over which they run: a new row counts for one in this many."""


class BestSoFar:
    """Running means of training, and whether the newest row is the best so far; of equals, the newest is.

    The success rate is the plain mean of the rows so far until there are `WINDOW` of them. The subtasks completed are
    averaged from 0 on: so a policy that succeeds by luck in its first rows is not the best.

    Args:
        trials: whether the best is told by `trial_progress`, where a row has it; otherwise by the running mean of the
            subtasks completed in training.
    """

    def __init__(self, trials: bool = False) -> None:
        self.trials, self.rated = trials, 0
        self.recent, self.best, self.improved = dict.fromkeys(FOLLOWED, 0.0), -1.0, False

    def add(self, row: Mapping[str, Any]) -> None:
        """Follows one row of the metrics; a column that it lacks, or that is nan, is left as it was."""
        success, completed = (row.get(name, math.nan) for name in FOLLOWED)
        if not math.isnan(success):
            self.rated += 1
            self.recent["success_rate"] += (success - self.recent["success_rate"]) / min(self.rated, WINDOW)
        if not math.isnan(completed):
            self.recent["completed"] += (completed - self.recent["completed"]) / WINDOW
        measured = row.get("trial_progress" if self.trials else "completed", math.nan)
        judged = measured if self.trials else self.recent["completed"]
        self.improved = not math.isnan(measured) and judged >= self.best
        if self.improved:
            self.best = judged

    def __str__(self) -> str:
        """The running success rate; "-" before any."""
        return f"{self.recent['success_rate']:.2f}" if self.rated else "-"

    def state_dict(self) -> dict[str, Any]:
        """The running means and the best."""
        return {"recent": dict(self.recent), "rated": self.rated, "best": self.best}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Goes back to `state`, which may have more entries."""
        self.recent = {name: float(state["recent"][name]) for name in FOLLOWED}
        self.rated, self.best = (
            int(state.get("rated", WINDOW)),
            float(state["best"]),
        )  # an older version: many
