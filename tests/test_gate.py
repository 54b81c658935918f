"""The gate of a chain: which of two policies stays, judged by the skill alone or by the whole chain."""

import pytest
from tensordict import TensorDict

from tstar_rl.chaining import chain
from tstar_rl.chaining.chain import TurnEnd, keep_better


class OneNumber:
    """Stands for a skill: its whole network is a number."""

    def __init__(self, number: float) -> None:
        self.number = number

    def network_state(self) -> dict:
        return {"number": self.number}

    def load_network_state(self, state: dict) -> None:
        self.number = state["number"]


@pytest.fixture
def handed(monkeypatch) -> list[float]:
    """What was handed over; a trial's success is the number itself, and so is what it reached."""
    over: list[float] = []
    monkeypatch.setattr(chain, "try_out", lambda skill, env: (skill.number, TensorDict({"is": skill.number})))
    monkeypatch.setattr(chain, "hand_over", lambda skill, last: over.append(float(last["is"])))
    return over


@pytest.mark.parametrize(("trained", "kept"), [(0.95, 0.95), (0.89, 0.89), (0.85, 0.9)])
def test_a_skill_that_lost_more_than_the_margin_goes_back_and_hands_over_what_it_reached(
    trained, kept, handed
):
    skill = OneNumber(trained)
    log = keep_better(skill, {"number": 0.9}, lambda: None, 0.02)
    assert skill.number == kept and handed == [pytest.approx(kept)]
    assert log == {"trial_before": 0.9, "trial_after": trained, "accepted": int(kept == trained)}


@pytest.mark.parametrize(("progress_after", "kept"), [(0.5, 0.95), (0.3, 0.9)])
def test_the_whole_chain_decides_where_it_is_asked(progress_after, kept, handed):
    skill = OneNumber(0.95)  # alone it is better
    log = keep_better(
        skill, {"number": 0.9}, lambda: None, 0.0, lambda: progress_after if skill.number == 0.95 else 0.4
    )
    assert skill.number == kept and handed == [pytest.approx(kept)]
    assert log["trial_progress"] == max(progress_after, 0.4)


def test_a_trial_of_the_chain_that_is_known_is_not_run_again(handed):
    skill, trials = OneNumber(0.95), []

    def progress() -> float:
        trials.append(skill.number)
        return 0.3

    log = keep_better(skill, {"number": 0.9}, lambda: None, 0.0, progress, progress_before=0.4)
    assert trials == [0.95] and skill.number == 0.9 and log["trial_progress"] == 0.4


def test_a_chain_that_was_tried_after_a_turn_is_not_tried_again_before_the_next(handed):
    trials, skill = [], OneNumber(0.5)

    def progress() -> float:
        trials.append(skill.number)
        return skill.number

    end_turn = TurnEnd(progress, True, "chain", 0.0, 1)
    logs = []
    for turn, trained in enumerate((0.6, 0.4, 0.7)):
        before = skill.network_state()
        skill.load_network_state({"number": trained})
        logs.append(end_turn(skill, before, lambda: None, turn))
    assert trials == [0.6, 0.5, 0.4, 0.7]  # before the first turn nothing is known
    assert [log["trial_progress"] for log in logs] == [0.6, 0.6, 0.7]
    assert [log["accepted"] for log in logs] == [1, 0, 1]


def test_without_a_gate_the_chain_is_tried_every_so_many_turns():
    skill = OneNumber(0.5)
    end_turn = TurnEnd(lambda: 0.25, False, "skill", 0.0, 2)
    assert [end_turn(skill, {}, lambda: None, turn) for turn in range(2)] == [{}, {"trial_progress": 0.25}]
