"""Recovery: a chain whose arm goes home before a skill that is expected to fail begins, or once it has tried for long.

No policy is trained for it. F, a classifier of the next skill's outcomes, is asked where a skill is handed over.

Source: ours.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from tensordict import TensorDictBase
from torch import Tensor, nn

from tstar_rl.chaining.calibration import Reliability
from tstar_rl.chaining.chain import ChainPolicy
from tstar_rl.chaining.signals import judge
from tstar_rl.chaining.skill import Skill
from tstar_rl.chaining.trials import SkillTrial
from tstar_rl.checks import InvalidValueError, check_ranges
from tstar_rl.models.draws import generators_stay
from tstar_rl.signal_equations import feasibility, outcome_loss
from tstar_rl.transforms import FeasibilityReward
from tstar_rl.updates import LabelledSettings, LabelledUpdate

__all__ = ["FEASIBILITY", "RecoveringChain", "RecoverySettings", "judge_outcomes", "learn_outcomes"]

FEASIBILITY = "feasibility"
"""The name of F among a skill's networks."""

WayHome = Callable[[Tensor], tuple[Tensor, Tensor]]
"""Observations (n, O) -> actions (n, 9) towards home, and whether the arm is there, (n,) bool."""


@dataclass(frozen=True)
class RecoverySettings:
    """When the arm goes home, so that the skill whose turn it is begins from there."""

    at_most: float | None = 0.5
    """Where a skill is handed over: if F of it is at most this. None: never; 1: always."""
    blind: bool = False
    """The arm goes home at random, before each skill as often as F would have sent it among the states that it learned
    from: the control that tells what F knows of a state."""
    patience: int | None = None
    """When a skill has acted for so many steps since it began, or since the arm got home. None: never."""
    most_steps: int = 40
    """Of one way home, after which the skill acts wherever the arm is."""

    def __post_init__(self) -> None:
        check_ranges(self, positive_share=("at_most",), count=("patience", "most_steps"))
        if self.blind and not self.uses_f:
            raise InvalidValueError(
                "recovery.blind draws as often as F would send the arm home, and F has no say: recovery.at_most must "
                f"be below 1, got {self.at_most}"
            )
        if self.at_most is None and self.patience is None:
            raise InvalidValueError(
                "the arm would never go home: recovery.at_most or recovery.patience must be a number"
            )

    @property
    def uses_f(self) -> bool:
        """Whether anything hangs on what F says."""
        return self.at_most is not None and self.at_most < 1.0

    def share_of(self, logit: Tensor | None) -> float:
        """The share of hand-overs at which the arm goes home.

        Args:
            logit: raw outputs of F for states that were handed over, (n, 1); None where F has no say, or where it is
                unknown since the skill was never handed over: the arm then always goes home.
        """
        if self.at_most is None:
            return 0.0
        return 1.0 if logit is None else float(self.expects_failure(logit).double().mean())

    def expects_failure(self, logit: Tensor) -> Tensor:
        """Whether the arm goes home from states with these raw outputs of F, (n, 1) -> (n,) bool."""
        return (feasibility(logit) <= (0.0 if self.at_most is None else self.at_most)).squeeze(-1)


def learn_outcomes(
    skill: Skill, starts: Tensor, succeeded: Tensor, settings: LabelledSettings, seed: int
) -> dict[str, float]:
    """Makes a skill's network `FEASIBILITY` and teaches it F of these starts; returns what is logged.

    Args:
        skill: without such a network.
        starts: (n, O), where the skill took over.
        succeeded: (n,) bool, what came of each.
        settings: how it learns.
        seed: of its first weights, minibatches and noise.

    Raises:
        InvalidValueError: if it has one, which may have learned something else.
    """
    if FEASIBILITY in skill.networks:
        raise InvalidValueError(
            f"skill {skill.subtask} has a network {FEASIBILITY} already: F learns from its first weights on"
        )
    with generators_stay(skill.initiation_set.device):
        torch.manual_seed(seed)
        network = skill.add_network(FEASIBILITY, settings.floor)
    return LabelledUpdate(FEASIBILITY, network, outcome_loss, settings, seed)(starts, succeeded)


def judge_outcomes(skill: Skill, found: SkillTrial) -> tuple[dict[str, float], Reliability | None]:
    """How well F tells what came of hand-overs that it did not learn from.

    Args:
        skill: with an F.
        found: what a trial from other starts tells of it.

    Returns:
        handed (how many hand-overs), next_success (the share that came to one) and the columns of `judge`; the curve.
    """
    signal = FeasibilityReward(skill.network(FEASIBILITY))
    columns, curve = judge(FEASIBILITY, signal, found.starts, found.succeeded, found.succeeded)
    return {"handed": len(found.starts), "next_success": found.success, **columns}, curve


@dataclass
class _Rows:
    """Where the episode of each simulation stands, (N,) int64 each."""

    subtask: Tensor
    acted: Tensor
    """Steps of the skill since it began, or since the arm got home."""
    left: Tensor
    """Steps that its way home may still take; 0: it is on none."""
    homings: Tensor
    """Ways home in the episode."""


class RecoveringChain(ChainPolicy):
    """A `ChainPolicy` that also sends the arm home. It remembers each row's episode until one with step_count 0.

    So it is the policy of one environment: another one, of as many simulations, needs one of its own.

    Reads "done" and "step_count" too. The first skill begins at home, so that F has no say there.

    Args:
        skills: in the order of the subtasks; F is their network `FEASIBILITY`.
        way_home: see `WayHome`.
        settings: when.
        shares: of the hand-overs to each skill but the first, those that go home. They are drawn where F has no say,
            and at a skill without F.

    Raises:
        ValueError: if there is not one share for each skill but the first.
    """

    def __init__(
        self, skills: Sequence[Skill], way_home: WayHome, settings: RecoverySettings, shares: Sequence[float]
    ) -> None:
        super().__init__(skills)
        if len(shares) != len(skills) - 1:
            raise ValueError(
                f"recovery needs a share of every skill but the first: {len(skills) - 1}, got {len(shares)}"
            )
        self.in_keys = ["observation", "subtask", "done", "step_count"]
        self.way_home, self.settings, self.shares = way_home, settings, tuple(shares)
        asked = skills[1:] if settings.uses_f and not settings.blind else []
        known = [skill for skill in asked if FEASIBILITY in skill.networks]
        self.networks = nn.ModuleDict({str(skill.subtask): skill.networks[FEASIBILITY] for skill in known})
        self._rows: _Rows | None = None

    @property
    def homings(self) -> Tensor:
        """(N,) int64, how often the arm of each row went home in its episode."""
        return torch.zeros(0, dtype=torch.int64) if self._rows is None else self._rows.homings

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """tensordict: any batch size -> the same with "action" (*batch, 9). `homings` are of its rows end to end."""
        if tensordict.ndim != 1:
            rows = self.forward(tensordict.select(*self.in_keys).reshape(-1))
            return tensordict.set("action", rows["action"].reshape(*tensordict.batch_size, -1))
        tensordict = super().forward(tensordict)
        observation = tensordict["observation"]
        rows, handed = self._follow(tensordict)
        over = tensordict["done"].squeeze(-1) | (rows.subtask >= len(self.policies))
        sent = self._sent_home(observation, rows, handed) & ~over
        rows.left[sent], rows.acted[sent] = self.settings.most_steps, 0
        if bool((rows.left > 0).any()):
            action, there = self.way_home(observation)
            rows.left[there] = 0
            going = rows.left > 0
            tensordict["action"][going] = action[going]
            rows.homings += sent & going
        rows.acted = torch.where(rows.left > 0, 0, rows.acted + 1)
        rows.left = (rows.left - 1).clamp_min(0)
        return tensordict

    def _follow(self, tensordict: TensorDictBase) -> tuple[_Rows, Tensor]:
        """The rows as they are now, and which of them a skill has just handed over, (N,) bool."""
        subtask, begins = tensordict["subtask"].squeeze(-1), tensordict["step_count"].squeeze(-1) == 0
        before = self._rows
        if before is None or before.subtask.shape != subtask.shape or before.subtask.device != subtask.device:
            self._rows = before = _Rows(subtask, *(torch.zeros_like(subtask) for _ in range(3)))
        rows, handed = before, (subtask != before.subtask) & ~begins
        new = handed | begins
        rows.subtask = subtask.clone()
        rows.acted, rows.left = rows.acted.masked_fill(new, 0), rows.left.masked_fill(new, 0)
        rows.homings = rows.homings.masked_fill(begins, 0)
        return rows, handed

    def _sent_home(self, observation: Tensor, rows: _Rows, handed: Tensor) -> Tensor:
        """Which rows are sent home now, (N,) bool; none that is on its way."""
        sent = torch.zeros_like(handed)
        if self.settings.patience is not None:
            sent |= (rows.left == 0) & (rows.acted >= self.settings.patience)
        for index, share in enumerate(self.shares, start=1):
            here = handed & (rows.subtask == index)
            if not bool(here.any()):
                continue
            if str(index) in self.networks:
                sent[here] = self.settings.expects_failure(self.networks[str(index)](observation[here]))
            else:
                sent[here] = torch.rand(int(here.sum()), device=here.device) < share
        return sent
