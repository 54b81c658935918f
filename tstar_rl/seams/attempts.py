"""Attempts of a chain's skills: how far parts had moved when each began, and whether it succeeded."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd
from tensordict import TensorDictBase
from torch import Tensor

from tstar_rl.seams.apart import apart

__all__ = ["Attempts"]


class Attempts:
    """A row for each attempt, one after another in each episode.

    Args:
        parts: by the name of a column, a part of each subtask, by its place in the observation: the one that it moves,
            say.

    Attributes:
        skills: how many there are.
    """

    def __init__(self, parts: Mapping[str, Sequence[int]]) -> None:
        self.parts, self.skills = parts, min(map(len, parts.values()))
        self._found: list[dict[str, Any]] = []
        self._open: dict[int, dict[str, Any]] = {}

    def begin(self, row: int, values: dict[str, int], before: Tensor, now: Tensor) -> None:
        """Begins one of values["skill"] in simulation `row`, whose parts were at `before` (P, 7) and are at `now`."""
        attempt: dict[str, Any] = dict(values)
        for name, of_skill in self.parts.items():
            part = of_skill[attempt["skill"]]
            attempt |= apart(name, before[part], now[part])
        attempt["succeeded"] = 0
        self._found.append(attempt)
        self._open[row] = attempt

    def end(self, tensordict: TensorDictBase, done: Tensor) -> None:
        """Notes which attempts succeed with this step; tensordict, done: batch [N]."""
        advanced = tensordict["next", "completed"] > tensordict["completed"]
        for row in (advanced.squeeze(-1).cpu() & ~done).nonzero().squeeze(-1).tolist():
            self._open.pop(row, {})["succeeded"] = 1

    def table(self, *values: str) -> pd.DataFrame:
        """A row for each attempt, in the order in which they began: `values`, distances and angles, succeeded."""
        measured = [f"{name}_{what}" for name in self.parts for what in ("moved", "turned")]
        return pd.DataFrame(self._found, columns=[*values, *measured, "succeeded"])
