"""Episodes begin where a classifier of the skill's own outcomes expects failure, in that skill's turn alone."""

from unittest.mock import Mock

import pytest

from tstar_rl.chaining.turn_starts import begin_where_it_fails
from tstar_rl.chaining.turns import Turn
from tstar_rl.checks import InvalidValueError

TWO = ("chain.gate=false", "chain.links=2")


def test_hard_starts_are_those_where_f_expects_failure(point_chain, monkeypatch):
    """Skill 1 fails at y < 0. Its own classifier comes to know, and chained episodes begin there more often.

    In a single turn of skill 1, so that nothing of it was learned in a turn of skill 0.
    """
    began = {}
    log = Turn.log

    def note(turn, rollout, row):
        if turn.index == 1:
            chained = rollout["start_observation"][rollout["start_chained"].squeeze(-1)]
            began.setdefault(share, []).append(float((chained[:, 1] < 0).float().mean()))
        log(turn, rollout, row)

    monkeypatch.setattr(Turn, "log", note)
    values = (
        *TWO,
        "chain.trial_every=100",
        "chain.order=backward",
        "chain.rounds=1",
        "chain.steps_per_turn=2048",
        "reward.weights.tsr=0",
        "feasibility.learning_rate=3e-3",
        "feasibility.steps=256",
    )
    for share in (0.0, 1.0):
        table = point_chain("feasibility", *values, f"hard_starts={share}", f"system=hard_{share}")
        assert ("own_feasibility_loss" in table) == bool(share)
    assert began[0.0][-1] < 0.65 and began[1.0][-1] > 0.85


@pytest.mark.parametrize("share", [-0.5, 1.5])
def test_a_share_of_hard_starts_that_is_none_is_refused(share):
    with pytest.raises(InvalidValueError, match=rf"expected failure must be in \[0, 1\], got {share}"):
        begin_where_it_fails(Mock(spec=Turn), lambda states: states, share)


def test_hard_starts_end_with_their_turn(point_chain, monkeypatch):
    """Skill 1 has two turns in a row; each begins with starts that are drawn alike, as a run that is resumed does."""
    begun, begin = [], Turn.rollouts

    def note(turn):
        if turn.previous is not None:
            states = turn.previous.termination_set
            begun.append(states._weighed_at == states.changes)
        return begin(turn)

    monkeypatch.setattr(Turn, "rollouts", note)
    monkeypatch.setattr("tstar_rl.chaining.turn_order.TurnOrder.skill_of", lambda order, turn: 1)
    values = ["chain.trial_every=100", "chain.rounds=1", "chain.steps_per_turn=1024", "hard_starts=1.0"]
    table = point_chain("feasibility", *TWO, *values)
    assert begun == [False, False] and table.own_feasibility_loss.notna().any()
