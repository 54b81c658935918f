"""Where a chain's parts lie when a skill takes over, against where the episode put them, and what came of it."""

from collections.abc import Mapping, Sequence

import pandas as pd
from tensordict import TensorDictBase
from torch import Tensor

from tstar_rl.seams.apart import part_poses
from tstar_rl.seams.attempts import Attempts

__all__ = ["MovedParts", "success_by_moved"]


class MovedParts:
    """Notes every hand-over of a chain; `each_step` of `run_episodes`, one episode of each simulation.

    Args:
        parts: by the name of a column, a part of each subtask, by its place in the observation: the one that it moves,
            say.
    """

    def __init__(self, parts: Mapping[str, Sequence[int]]) -> None:
        self._attempts = Attempts(parts)
        self._skill: Tensor | None = None

    def __call__(self, tensordict: TensorDictBase) -> None:
        """tensordict: batch [N], as `run_episodes` hands it on."""
        skill, done = (tensordict[name].squeeze(-1).cpu() for name in ("subtask", "done"))
        poses = part_poses(tensordict["observation"])
        if self._skill is None:
            self._skill, self._began_at = skill.clone(), poses.clone()
        taken_over = (skill != self._skill) & (skill < self._attempts.skills) & ~done
        for row in taken_over.nonzero().squeeze(-1).tolist():
            values = {"skill": int(skill[row]), "step": int(tensordict["step_count"][row])}
            self._attempts.begin(row, values, self._began_at[row], poses[row])
        self._attempts.end(tensordict, done)
        self._skill = skill.clone()

    def table(self) -> pd.DataFrame:
        """A row for each hand-over, in the order in which they happened.

        Columns: skill, which takes over; step of the episode; <name>_moved (m) and <name>_turned (degrees), the
        distance and angle of a part between the episode's first state and the hand-over; succeeded.
        """
        return self._attempts.table("skill", "step")


def success_by_moved(table: pd.DataFrame, from_metres: float, from_degrees: float) -> pd.DataFrame:
    """How often each skill succeeds where its part was moved before its turn, and where it was not.

    Args:
        table: of `MovedParts`, whose column "part" is of the part that a skill moves.
        from_metres, from_degrees: a part that was moved or turned by so much, or more, counts as moved.

    Returns:
        Index skill and "its part", "moved" or "not moved"; columns size, of hand-overs, and mean, the share that
        succeeded.
    """
    moved = (table["part_moved"] >= from_metres) | (table["part_turned"] >= from_degrees)
    which = moved.map({True: "moved", False: "not moved"}).rename("its part")
    return table["succeeded"].groupby([table["skill"], which]).agg(["size", "mean"])
