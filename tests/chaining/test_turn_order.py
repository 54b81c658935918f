"""Whose turn it is, on trials worked by hand and on a chain of a point."""

import pytest
import torch
from tensordict import TensorDict

from tstar_rl.chaining.paths import Path
from tstar_rl.chaining.trials import SkillTrial, Trial
from tstar_rl.chaining.turn_order import TurnOrder

TEN = (0, 1, 1, 1, 1, 2, 2, 2, 3, 3)
"""Subtasks done in ten episodes."""


def trial(*completed: int, skills: int = 3) -> Trial:
    """Episodes that did so many subtasks each."""
    found, nothing = [], torch.arange(0)
    for skill in range(skills):
        simulations = torch.tensor(
            [place for place, done in enumerate(completed) if done >= skill], dtype=torch.int64
        )
        won = torch.tensor([done > skill for done in completed if done >= skill], dtype=torch.bool)
        starts, path = torch.zeros(len(won), 2), Path(torch.zeros(0, 2), nothing, nothing)
        found.append(SkillTrial(starts, won, TensorDict(batch_size=[0]), won[:0], simulations, path, 0))
    return Trial(found)


def test_what_a_skills_failures_cost():
    """Ten episodes of three skills: skill 0 fails in 1, skill 1 in 4 of 9, skill 2 in 3 of 5."""
    tried = trial(*TEN)
    assert tried.cost(0) == pytest.approx(1 * (1 + 5 / 9 + 5 / 9 * 2 / 5) / 30)
    assert tried.cost(1) == pytest.approx(4 * (1 + 2 / 5) / 30)
    assert tried.cost(2) == pytest.approx(3 / 30)
    perfect = trial(3, 3)
    assert [perfect.cost(skill) for skill in range(3)] == [0, 0, 0]


def test_nothing_is_known_against_a_skill_that_never_began():
    assert trial(0, 0).cost(0) == 1.0 and trial(0, 0).cost(1) == 0.0


def test_a_skill_whose_turn_was_put_back_waits():
    """Costs are .06, .19 and .10. Once a turn is kept, or all were put back, the costliest is asked again."""
    order = TurnOrder("costliest", 3)
    assert [order.skill_of(turn) for turn in range(4)] == [0, 1, 2, 0], "before any trial"
    order.note(trial(*TEN))
    turns = [order.skill_of(0)]
    for kept in (False, False, False, False, True):
        order.note(trial(*TEN), turns[-1], kept)
        turns.append(order.skill_of(len(turns)))
    assert turns == [1, 2, 0, 1, 2, 1]


def test_the_order_goes_on_from_its_state():
    order, resumed = TurnOrder("costliest", 3), TurnOrder("costliest", 3)
    order.note(trial(*TEN))
    order.note(None, 1, kept=False)
    resumed.load_state_dict(order.state_dict())
    assert resumed.skill_of(1) == order.skill_of(1) == 2


def test_after_a_turn_that_was_put_back_costs_are_those_of_the_chain_that_is_kept(
    spoiled_turns, point_chain, monkeypatch
):
    """The chain that was tried walks backwards, and all of its failures are skill 0's."""
    noted = []
    note = TurnOrder.note

    def watched(order, kept, *more, **named):
        if kept is not None:
            noted.append([kept.cost(skill) for skill in range(2)])
        note(order, kept, *more, **named)

    monkeypatch.setattr(TurnOrder, "note", watched)
    table = point_chain("tstar", "chain.gate=true", "chain.order=costliest", "chain.links=2")
    assert table.accepted.dropna().tolist() == [0, 0] and len(noted) > 1
    assert all(first == 0 < second for first, second in noted)


def test_the_costliest_skill_has_the_turn(point_chain):
    """On the point skill 0 always succeeds and skill 1 fails half of the time; whoever gets past it succeeds."""
    table = point_chain("tstar", "chain.order=costliest", "chain.rounds=1", "chain.steps_per_turn=512")
    assert table.skill.iloc[0] == 1
    trials = table[["trial_before", "trial_after"]]
    assert (trials.iloc[0] < 1).all() and len(table) == 4
