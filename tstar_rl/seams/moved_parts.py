"""Where a chain's parts lie when a skill takes over, against where the episode put them, and what came of it."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd
from tensordict import TensorDictBase
from torch import Tensor

from tstar_rl.seams.apart import apart, part_poses

__all__ = ["MovedParts"]


class MovedParts:
    """Notes every hand-over of a chain; `each_step` of `run_episodes`, one episode of each simulation.

    Args:
        parts: by the name of a column, a part of each subtask, by its place in the observation: the one that it moves,
            say.
    """

    def __init__(self, parts: Mapping[str, Sequence[int]]) -> None:
        self.parts = parts
        self._found: list[dict[str, Any]] = []
        self._open: dict[int, dict[str, Any]] = {}
        self._skill: Tensor | None = None

    def __call__(self, tensordict: TensorDictBase) -> None:
        """tensordict: batch [N], as `run_episodes` hands it on."""
        skill, done = (tensordict[name].squeeze(-1).cpu() for name in ("subtask", "done"))
        poses = part_poses(tensordict["observation"])
        if self._skill is None:
            self._skill, self._began_at = skill.clone(), poses.clone()
        for row in ((skill != self._skill) & ~done).nonzero().squeeze(-1).tolist():
            seam: dict[str, Any] = {"skill": int(skill[row]), "step": int(tensordict["step_count"][row])}
            for name, of_skill in self.parts.items():
                part = of_skill[seam["skill"]]
                seam |= apart(name, self._began_at[row, part], poses[row, part])
            seam["succeeded"] = 0
            self._found.append(seam)
            self._open[row] = seam
        advanced = tensordict["next", "completed"] > tensordict["completed"]
        for row in (advanced.squeeze(-1).cpu() & ~done).nonzero().squeeze(-1).tolist():
            self._open.pop(row, {})["succeeded"] = 1
        self._skill = skill.clone()

    def table(self) -> pd.DataFrame:
        """A row for each hand-over, in the order in which they happened.

        Columns: skill, which takes over; step of the episode; <name>_moved (m) and <name>_turned (degrees), the
        distance and angle of a part between the episode's first state and the hand-over; succeeded.
        """
        measured = [f"{name}_{what}" for name in self.parts for what in ("moved", "turned")]
        return pd.DataFrame(self._found, columns=["skill", "step", *measured, "succeeded"])
