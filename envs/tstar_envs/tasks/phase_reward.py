"""The dense reward of one subtask: eight phases, each a potential to lower and a condition to meet.

A phase's *potential* is its clipped distances times their coefficients; the reward of a step is ten times what the
potential of the current phase fell by, and a bonus when its condition holds. Both are tables over what is measured
(`measures`): everything is computed for all eight phases at once, (N, 8), and the current one is picked, so no shape
depends on data.

Source: docs/task.md, "Dense reward of one subtask".
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

from tstar_envs.tasks.measures import MEASURES

PHASES = (
    "init_eef",
    "move_eef_above_leg",
    "lower_eef",
    "grasp_leg",
    "lift_leg",
    "align_leg",
    "move_leg",
    "move_leg_fine",
)
BONUS = 5000.0
BONUS_SHARES = (1.0, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0)
DIFFERENCE_SCALE = 10.0
MIN_GRIP_COSINE = 0.95


class Term(NamedTuple):
    """A measure m, clipped to [least, most]; with a rate, exp(-rate * |m - best|) of it, `best` a bound of m."""

    measure: str
    most: float = math.inf
    least: float = -math.inf
    rate: float = 0.0
    best: float = 0.0


def _far(measure: str, most: float) -> Term:
    """A distance, counted up to `most`."""
    return Term(measure, most)


def _near(measure: str, rate: float, most: float = math.inf) -> Term:
    """Grows to 1 as a distance, counted up to `most`, falls to 0."""
    return Term(measure, most, rate=rate)


def _parallel(measure: str, rate: float) -> Term:
    """Grows to 1 as a cosine does."""
    return Term(measure, rate=rate, best=1.0)


_LOWER = ((1000.0, _far("tip_to_below", 0.2)),)
POTENTIALS: dict[str, tuple[tuple[float | Term, ...], ...]] = {
    "init_eef": ((-100.0, _near("tip_to_start", 10.0, 0.5)),),
    "move_eef_above_leg": ((100.0, _far("tip_to_above", 1.0)),),
    "lower_eef": _LOWER,
    "grasp_leg": _LOWER,
    "lift_leg": (
        (500.0, _far("part_to_lift_height", 0.5)),
        (250.0, _far("part_to_lift_plane", 0.8)),
    ),
    "align_leg": ((100.0, _far("part_to_lift", 0.4)), (-50.0, Term("up"), Term("forward"))),
    "move_leg": (
        (300.0, _far("to_fine", 0.5)),
        (-50.0, Term("up", least=0.0), Term("forward", least=0.0)),
    ),
    "move_leg_fine": (
        (-500.0, _near("gap", 25.0)),
        (-200.0, _parallel("up", 2.0), _parallel("forward", 2.0)),
        (-100.0, _parallel("moving_projection", 3.0), _parallel("target_projection", 3.0)),
    ),
}
"""Of each phase: summands, each a coefficient and the terms whose sum it multiplies."""

_GRIP_DOWN = ("down", MIN_GRIP_COSINE, math.inf)
_GRIP = (_GRIP_DOWN, ("turn", MIN_GRIP_COSINE, math.inf))
_UPRIGHT = (("up", 0.85, math.inf), ("forward", 0.85, math.inf), "touching")


def _below(measure: str, most: float) -> tuple[str, float, float]:
    return measure, -math.inf, most


CONDITIONS: dict[str, tuple[str | tuple[str, float, float], ...]] = {
    "init_eef": (_below("tip_to_start", 0.03), _GRIP_DOWN, "hand_open"),
    "move_eef_above_leg": (_below("tip_to_above", 0.03), *_GRIP, "hand_open"),
    "lower_eef": (
        _below("tip_to_below_plane", 0.02), _below("tip_to_below_height", 0.015), *_GRIP, "hand_open",
    ),
    "grasp_leg": ("touching", _below("tip_over_grasp", 0.0), *_GRIP),
    "lift_leg": (_below("part_to_lift_height", 0.02), _below("part_to_lift_plane", 0.05), *_GRIP),
    "align_leg": (_below("part_to_lift", 0.2), *_UPRIGHT),
    "move_leg": (_below("to_fine", 0.06), *_UPRIGHT),
    "move_leg_fine": ("connected",),
}  # fmt: skip
"""Of each phase: what has to hold, a flag by name or a measure between two bounds (bounds excluded)."""
_FLAGS = ("touching", "hand_open", "connected")


class PhaseTables:
    """`POTENTIALS` and `CONDITIONS` as tensors on `device`."""

    def __init__(self, device: torch.device):
        self._potentials = _Potentials(device)
        self._conditions = _Conditions(device)

    def potentials(self, measures: Tensor) -> Tensor:
        """Potential of each phase, (N, 8), of what is measured, (M, N)."""
        return self._potentials(measures)

    def conditions(self, measures: Tensor, touching: Tensor, hand_open: Tensor, connected: Tensor) -> Tensor:
        """Whether each phase's condition holds, (8, N) bool; the flags are (N,) bool."""
        return self._conditions(measures, torch.stack([touching, hand_open, connected]))


class _Potentials:
    """Terms first, each once; then the sums: two terms of a summand, three summands of a phase."""

    def __init__(self, device: torch.device):
        used = dict.fromkeys(
            term for phase in POTENTIALS.values() for summand in phase for term in summand[1:]
        )
        terms = sorted((term for term in used if isinstance(term, Term)), key=lambda term: term.rate > 0)
        terms.insert(0, Term("gap", most=0.0, least=0.0))  # stands where there is nothing to add
        self._plain = sum(term.rate == 0 for term in terms)
        decaying = terms[self._plain :]

        def row(values: list[float]) -> Tensor:
            return torch.tensor(values, dtype=torch.float64, device=device).unsqueeze(-1)

        self._rows = torch.tensor([MEASURES[term.measure] for term in terms], device=device)
        self._sign = row([-1.0 if term.measure.endswith("projection") else 1.0 for term in terms])
        self._least, self._most = row([term.least for term in terms]), row([term.most for term in terms])
        self._best = row([term.best for term in decaying])
        self._rate = row([term.rate if term.best else -term.rate for term in decaying])
        places, factors = [], []
        for phase in PHASES:
            for summand in [*POTENTIALS[phase], (0.0,), (0.0,)][:3]:
                found = [terms.index(term) for term in summand[1:] if isinstance(term, Term)]
                places += [*found, 0, 0][:2]
                factors.append(summand[0])
        self._places = torch.tensor(places, device=device)
        self._factors = torch.tensor(factors, dtype=torch.float64, device=device).view(len(PHASES), 3, 1)

    def __call__(self, measures: Tensor) -> Tensor:
        found = measures.index_select(0, self._rows)
        found = torch.maximum(found, found * self._sign).clamp(self._least, self._most)
        decaying = torch.exp((found[self._plain :] - self._best) * self._rate)
        terms = torch.cat([found[: self._plain], decaying])
        summands = terms.index_select(0, self._places).view(len(PHASES), 3, 2, -1).sum(2)
        return (summands * self._factors).sum(1).t().contiguous()


class _Conditions:
    """Each bound and flag once; then, of each phase, whether all of its own hold."""

    def __init__(self, device: torch.device):
        bounds = list(
            dict.fromkeys(b for phase in CONDITIONS.values() for b in phase if not isinstance(b, str))
        )
        order = [*bounds, *_FLAGS]
        longest = max(len(phase) for phase in CONDITIONS.values())
        places = [[order.index(b) for b in CONDITIONS[phase]] for phase in PHASES]
        self._rows = torch.tensor([MEASURES[measure] for measure, _, _ in bounds], device=device)
        edges = torch.tensor([edges for _, *edges in bounds], dtype=torch.float64, device=device)
        self._least, self._most = edges.t().unsqueeze(-1)
        filled = [row + row[-1:] * (longest - len(row)) for row in places]
        self._places = torch.tensor(filled, device=device).flatten()
        self._shape = (len(PHASES), longest, -1)

    def __call__(self, measures: Tensor, flags: Tensor) -> Tensor:
        found = measures.index_select(0, self._rows)
        held = torch.cat([(found > self._least) & (found < self._most), flags])
        return held.index_select(0, self._places).view(self._shape).all(1)
