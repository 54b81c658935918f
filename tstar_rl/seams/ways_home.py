"""What a chain with recovery finds when its arm goes home: where its parts lie, and whether the skill then succeeds."""

from collections.abc import Mapping, Sequence

import pandas as pd
import torch
from tensordict import TensorDictBase
from torch import Tensor

from tstar_rl.chaining.recovery import RecoveringChain
from tstar_rl.seams.apart import part_poses
from tstar_rl.seams.attempts import Attempts

__all__ = ["WaysHome"]


class WaysHome:
    """Notes every way home of a chain; `each_step` of `run_episodes`, one episode of each simulation.

    Args:
        policy: the chain.
        parts: by the name of a column, a part of each subtask, by its place in the observation: the one that it moves,
            say.
    """

    def __init__(self, policy: RecoveringChain, parts: Mapping[str, Sequence[int]]) -> None:
        self.policy, self._attempts = policy, Attempts(parts)
        self._skill: Tensor | None = None

    def __call__(self, tensordict: TensorDictBase) -> None:
        """tensordict: batch [N], as `run_episodes` hands it on."""
        skill, done = (tensordict[name].squeeze(-1).cpu() for name in ("subtask", "done"))
        poses = part_poses(tensordict["observation"])
        homings = self.policy.homings.cpu()
        if self._skill is None:
            self._skill, self._at_hand_over = torch.full_like(skill, -1), poses.clone()
            self._homings, self._ways = torch.zeros_like(homings), torch.zeros_like(homings)
        handed = skill != self._skill
        self._at_hand_over[handed], self._ways[handed] = poses[handed], 0
        for row in ((homings > self._homings) & ~done).nonzero().squeeze(-1).tolist():
            values = {"skill": int(skill[row]), "way": int(self._ways[row])}
            values["step"] = int(tensordict["step_count"][row])
            self._attempts.begin(row, values, self._at_hand_over[row], poses[row])
            self._ways[row] += 1
        self._attempts.end(tensordict, done)
        self._skill, self._homings = skill.clone(), homings.clone()

    def table(self) -> pd.DataFrame:
        """A row for each way home, in the order in which they began.

        Columns: skill; way, how often the arm had gone home before since the skill took over; step of the episode;
        <name>_moved (m) and <name>_turned (degrees), the distance and angle of a part between where it was when the
        skill took over and when the arm set out; succeeded, whether the skill did before it was sent home again.
        """
        return self._attempts.table("skill", "way", "step")
