"""Recovery: a chain whose arm goes home before a skill that is expected to fail begins, or once it has tried for long.

Nothing is trained for it but F, the classifier of the next skill's outcomes. It is asked where a skill is handed over.

Source: ours.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn

from tstar_rl.chaining.chain import ChainPolicy
from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import InvalidValueError, check_ranges
from tstar_rl.signal_equations import feasibility

__all__ = ["FEASIBILITY", "RecoveringChain", "RecoverySettings"]

FEASIBILITY = "feasibility"
"""The name of F among a skill's networks."""

WayHome = Callable[[Tensor], tuple[Tensor, Tensor]]
"""Observations (n, O) -> actions (n, 9) towards home, and whether the arm has arrived, (n,) bool."""


@dataclass(frozen=True)
class RecoverySettings:
    """When the arm goes home, so that the skill whose turn it is begins from there."""

    below: float | None = 0.5
    """Where a skill is handed over: if F of it is at most this. None: never; 1: always."""
    blind: bool = False
    """As often as F would ask for it, but drawn: the control that tells what F knows."""
    patience: int | None = None
    """When a skill has acted for so many steps since it began, or since the arm was home. None: never."""
    most_steps: int = 40
    """Of one way home, after which the skill acts wherever the arm is."""

    def __post_init__(self) -> None:
        check_ranges(self, share=("below",), count=("patience", "most_steps"))
        if self.blind and not self.asks_f:
            raise InvalidValueError(
                f"recovery.blind draws as often as F asks, and F is not asked: recovery.below must be below 1, "
                f"got {self.below}"
            )

    @property
    def asks_f(self) -> bool:
        """Whether anything hangs on what F says."""
        return self.below is not None and self.below < 1.0

    def share_of(self, logit: Tensor | None) -> float:
        """The share of hand-overs at which the arm goes home.

        Args:
            logit: raw outputs of F for states that were handed over, (n, 1); None where F is not asked.
        """
        if logit is None or not len(logit):
            return float(self.below == 1.0)
        return float(self.expects_failure(logit).double().mean())

    def expects_failure(self, logit: Tensor) -> Tensor:
        """Whether the arm goes home from states with these raw outputs of F, (n, 1) -> (n,) bool."""
        return (feasibility(logit) <= (self.below or 0.0)).squeeze(-1)


@dataclass
class _Rows:
    """Of each simulation, (N,): where its episode stands. `homings` counts ways home in the episode."""

    subtask: Tensor
    acted: Tensor
    left: Tensor
    homings: Tensor


class RecoveringChain(ChainPolicy):
    """A `ChainPolicy` that also sends the arm home. It remembers each row's episode until one with step_count 0.

    Reads "done" and "step_count" too. The first skill begins at home, so it is never sent there by F.

    Args:
        skills: in the order of the subtasks; F is their network `FEASIBILITY`.
        way_home: see `WayHome`.
        settings: when.
        shares: of the hand-overs to each skill but the first, how many go home; they are drawn where F is not asked.

    Raises:
        ValueError: if F is asked and a skill but the first has none, or there is not one share for each of them.
    """

    def __init__(
        self, skills: Sequence[Skill], way_home: WayHome, settings: RecoverySettings, shares: Sequence[float]
    ) -> None:
        super().__init__(skills)
        self.in_keys = ["observation", "subtask", "done", "step_count"]
        self.way_home, self.settings, self.shares = way_home, settings, tuple(shares)
        asked = skills[1:] if settings.asks_f and not settings.blind else []
        lacking = [skill.subtask for skill in asked if FEASIBILITY not in skill.networks]
        if lacking or len(shares) != len(skills) - 1:
            raise ValueError(
                f"recovery needs F and a share of every skill but the first; got no F of {lacking or 'none'}, and "
                f"{len(shares)} shares for {len(skills) - 1} skills"
            )
        self.networks = nn.ModuleList(skill.networks[FEASIBILITY] for skill in asked)
        self._rows: _Rows | None = None

    @property
    def homings(self) -> Tensor:
        """(N,) int64, how often the arm of each row was sent home in its episode."""
        return torch.zeros(0, dtype=torch.int64) if self._rows is None else self._rows.homings

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """tensordict: batch [N] -> the same with "action" (N, 9)."""
        tensordict = super().forward(tensordict)
        observation, live = tensordict["observation"], ~tensordict["done"].squeeze(-1)
        rows, handed = self._follow(tensordict)
        asked = live & self._asks(observation, rows, handed)
        rows.homings += asked
        rows.left[asked] = self.settings.most_steps
        away = rows.left > 0
        if bool(away.any()):
            action, arrived = self.way_home(observation)
            rows.left[arrived] = 0
            away = rows.left > 0
            tensordict["action"][away] = action[away]
        rows.left -= away.long()
        rows.acted = torch.where(away, 0, rows.acted + 1)
        return tensordict

    def _follow(self, tensordict: TensorDictBase) -> tuple[_Rows, Tensor]:
        """The rows as they are now, and which of them a skill has just handed over, (N,) bool."""
        subtask, begins = tensordict["subtask"].squeeze(-1), tensordict["step_count"].squeeze(-1) == 0
        if self._rows is None or self._rows.subtask.shape != subtask.shape:
            self._rows = _Rows(subtask.clone(), *(torch.zeros_like(subtask) for _ in range(3)))
        rows = self._rows
        handed = (subtask != rows.subtask) & ~begins
        new = handed | begins
        rows.subtask = subtask.clone()
        rows.acted, rows.left = rows.acted.masked_fill(new, 0), rows.left.masked_fill(new, 0)
        rows.homings = rows.homings.masked_fill(begins, 0)
        return rows, handed

    def _asks(self, observation: Tensor, rows: _Rows, handed: Tensor) -> Tensor:
        """Which rows are sent home now, (N,) bool; none that is on its way."""
        asks = torch.zeros_like(handed)
        if self.settings.patience is not None:
            asks |= (rows.left == 0) & (rows.acted >= self.settings.patience)
        for index, share in enumerate(self.shares):
            here = (handed & (rows.subtask == index + 1)).nonzero().squeeze(-1)
            if not len(here):
                continue
            if self.networks:
                asks[here] = self.settings.expects_failure(self.networks[index](observation[here]))
            else:
                asks[here] = torch.rand(len(here), device=here.device) < share
        return asks
