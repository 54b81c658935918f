"""Whose turn it is: skill after skill, the last one first, or the skill that costs the chain most."""

from typing import Any

from tstar_rl.chaining.chain_settings import Order
from tstar_rl.chaining.trials import Trial

__all__ = ["TurnOrder"]


class TurnOrder:
    """Which skill has the next turn.

    forward: from the first skill to the last, as in Algorithm 1. backward: from the last to the first. costliest: the
    skill whose failures cost the chain most progress in the last trial, see `Trial.cost`. One whose turn was put back
    waits until another skill's turn is kept, or all have had theirs put back. Before any trial, the order is forward.

    Args:
        order: one of these.
        skills: how many there are.
    """

    def __init__(self, order: Order, skills: int) -> None:
        self.order, self.skills = order, skills
        self._costs: list[float] = []
        self._put_back: list[int] = []

    def skill_of(self, turn: int) -> int:
        """Which skill has turn number `turn`."""
        place = turn % self.skills
        if self.order == "costliest" and self._costs:
            ready = [skill for skill in range(self.skills) if skill not in self._put_back]
            return max(ready, key=lambda skill: self._costs[skill])
        return self.skills - 1 - place if self.order == "backward" else place

    def note(self, trial: Trial | None, skill: int | None = None, kept: bool = True) -> None:
        """Takes what a turn has found.

        Args:
            trial: of the chain that goes on; None: there was none.
            skill: whose turn it was; None: it was before the first one.
            kept: whether the turn was.
        """
        if trial is not None:
            self._costs = [trial.cost(index) for index in range(self.skills)]
        if kept:
            self._put_back = []
        elif skill is not None:
            self._put_back = [*{*self._put_back, skill}] if len(self._put_back) + 1 < self.skills else []

    def state_dict(self) -> dict[str, Any]:
        """What the last trial said."""
        return {"costs": self._costs, "put_back": self._put_back}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """What `state_dict` gave."""
        self._costs, self._put_back = list(state["costs"]), list(state["put_back"])
