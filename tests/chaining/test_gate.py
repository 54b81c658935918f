"""The gate, which a trial of the chain decides: what it keeps, what it puts back, and what it tries again."""

from copy import deepcopy

import pytest
import torch
from tensordict import TensorDict

from tstar_rl.chaining.gate import Gate, GateSettings
from tstar_rl.chaining.paths import Path
from tstar_rl.chaining.trials import SkillTrial, Trial
from tstar_rl.chaining.turns import Turn


class Chain:
    """Stands for a chain of two skills: its progress is a number, and its trials are noted.

    A trial takes 7 steps of skill 0 and 3 of skill 1.
    """

    def __init__(self, number: float) -> None:
        self.number, self.trials, self.tried = number, [], []

    def run_trial(self, known: Trial | None, first: int) -> Trial:
        self.trials.append((self.number, None if known is None else known.progress, first))
        return of_progress(self.number)

    def turn(self, gate: Gate, number: int, trained: float):
        before, self.number = self.number, trained
        return gate.judge(
            number,
            number % 2,
            undo=lambda: setattr(self, "number", before),
            redo=lambda: setattr(self, "number", trained),
            tried=lambda trial: self.tried.append((self.number, trial.progress)),
        )


def of_progress(number: float) -> Trial:
    """Of 100 episodes in which skill 0 always succeeds."""
    before = torch.arange(100) < 100
    after = torch.arange(100) < round(200 * number - 100)
    nothing, states = torch.zeros(100, 0), TensorDict(batch_size=[0])
    path = Path(nothing[:0], torch.arange(0), torch.arange(0))
    return Trial(
        [
            SkillTrial(nothing, won, states, won[:0], torch.arange(100), path, steps)
            for won, steps in ((before, 7), (after, 3))
        ]
    )


def test_the_first_trial_counts_all_skills_whosever_turn_it_follows():
    chain = Chain(0.75)
    gate = Gate(GateSettings(False, 0.0, 1), chain.run_trial)
    assert gate.judge(0, 1, undo=print, redo=print).steps == 10
    assert chain.trials == [(0.75, None, 0)]


@pytest.mark.parametrize(("trained", "kept"), [(0.95, 0.95), (0.89, 0.89), (0.87, 0.9)])
def test_a_turn_that_lost_more_than_the_margin_is_put_back(trained, kept):
    chain = Chain(0.9)
    judgement = chain.turn(Gate(GateSettings(True, 0.02, 1), chain.run_trial), 0, trained)
    assert chain.number == kept and judgement.accepted == (kept == trained)
    assert judgement.kept.progress == pytest.approx(kept)
    assert chain.tried == [(trained, pytest.approx(trained))]  # looked at before it is put back
    success = {"trial_before": 0.8, "trial_after": 2 * trained - 1}
    progress = {
        "accepted": int(kept == trained),
        "tried_progress": trained,
        "trial_progress": kept,
        "trial_steps": 20,
    }
    assert judgement.row(1) == pytest.approx(success | progress)


def test_a_turn_that_changes_nothing_is_kept():
    chain = Chain(0.9)
    assert chain.turn(Gate(GateSettings(True, 0.0, 1), chain.run_trial), 0, 0.9).accepted


def test_a_trial_that_is_known_is_not_run_again_and_steps_are_counted_once():
    chain = Chain(0.7)
    gate = Gate(GateSettings(True, 0.0, 1), chain.run_trial)
    found = [chain.turn(gate, turn, trained) for turn, trained in enumerate((0.8, 0.6, 0.9))]
    # Before the first turn nothing is known; after it, what the chain did before, and which skill was trained.
    assert chain.trials == [(0.7, None, 0), (0.8, 0.7, 0), (0.6, 0.8, 1), (0.9, 0.8, 0)]
    assert [each.accepted for each in found] == [True, False, True]
    assert [each.steps for each in found] == [20, 3, 10]
    resumed = Gate(GateSettings(True, 0.0, 1), chain.run_trial)
    assert chain.turn(resumed, 3, 0.95).steps == 3  # the trial that it repeats was counted by the turn before
    assert chain.trials[4:] == [(0.9, None, 0), (0.95, 0.9, 1)] and chain.number == 0.95


def test_without_rejections_the_chain_is_tried_every_so_many_turns():
    chain = Chain(0.75)
    gate = Gate(GateSettings(False, 0.0, 2), chain.run_trial)
    found = [chain.turn(gate, turn, 0.6) for turn in range(4)]
    assert found[0].kept is None and found[1].kept.progress == pytest.approx(0.6)
    assert found[1].accepted is None and chain.number == 0.6
    assert [first for _, _, first in chain.trials] == [0, 0]  # both skills were trained in between
    assert [each.steps for each in found] == [0, 10, 0, 10]
    assert len(chain.tried) == 2


def test_without_rejections_a_trial_of_every_turn_begins_with_the_skill_that_was_trained():
    chain = Chain(0.75)
    gate = Gate(GateSettings(False, 0.0, 1), chain.run_trial)
    found = [chain.turn(gate, turn, trained) for turn, trained in enumerate((0.6, 0.8))]
    assert chain.trials == [(0.6, None, 0), (0.8, 0.6, 1)] and [each.steps for each in found] == [10, 3]
    resumed = Gate(GateSettings(False, 0.0, 1), chain.run_trial)
    assert chain.turn(resumed, 3, 0.9).steps == 3 and chain.trials[2:] == [(0.9, None, 1)]


def test_a_rejected_turn_puts_back_everything_that_it_changed(spoiled_turns, point_chain, monkeypatch):
    """Networks of the skill, d_omega of the next, both sets, and what the optimisers remember."""
    states = {}
    rollouts, say = Turn.rollouts, Turn._say_how_the_next_does

    def watched(turn):
        states["before", turn.run.turn] = turn._state()
        yield from rollouts(turn)
        states["after", turn.run.turn] = turn._state()

    def said(turn, trial):
        states["said", turn.run.turn] = turn._state()
        return say(turn, trial)

    monkeypatch.setattr(Turn, "rollouts", watched)
    monkeypatch.setattr(Turn, "_say_how_the_next_does", said)
    table = point_chain("tstar", "chain.gate=true", "chain.links=2")
    assert table.accepted.dropna().tolist() == [0, 0]
    for turn in range(2):
        before, after = flat(states["before", turn]), flat(states["after", turn])
        assert before.keys() == after.keys() and any("d_omega" in name for name in before)
        for name, value in before.items():
            same = (
                torch.equal(value, after[name]) if isinstance(value, torch.Tensor) else value == after[name]
            )
            assert same, (turn, name)
    begun, trained = states["before", 0], states["said", 0]
    updates = {"update_policy", "update_f_phi", "update_d_omega"}
    assert updates <= begun.keys() and {"update_policy", "update_f_phi"} <= states["before", 1].keys()
    for name in updates:  # what was put back had changed
        one, other = flat(begun[name]), flat(trained[name])
        assert one.keys() != other.keys() or any(
            str(value) != str(other[key]) for key, value in one.items()
        ), name
    # What is said of the chain that was tried is said by the networks that were trained with it.
    said, before = (flat(states[when, 0]["others"][1]["d_omega"]) for when in ("said", "before"))
    assert any(not torch.equal(value, before[name]) for name, value in said.items())


def test_a_rejected_turn_keeps_the_returns_of_the_episodes_that_run_on(
    spoiled_turns, point_chain, monkeypatch
):
    """The simulations are not put back, so each skill's next turn goes on with their returns."""
    at_end, begun = {}, {}
    end, rollouts = Turn._end, Turn.rollouts

    def watched(turn):
        begun.setdefault(turn.index, []).append(turn.kept["update_policy"].carried.clone())
        yield from rollouts(turn)

    def noted(turn):
        at_end.setdefault(turn.index, []).append(turn.kept["update_policy"].carried.clone())
        return end(turn)

    monkeypatch.setattr(Turn, "rollouts", watched)
    monkeypatch.setattr(Turn, "_end", noted)
    table = point_chain("tstar", "chain.gate=true", "chain.links=2", "chain.rounds=2")
    assert table.accepted.dropna().tolist() == [0] * 4
    for index in range(2):
        first, second = begun[index]
        assert not first.any() and at_end[index][0].any() and torch.equal(second, at_end[index][0])


@pytest.mark.parametrize(("gate", "copies"), [("false", 0), ("true", 3)])
def test_what_a_turn_changes_is_copied_only_for_a_gate(gate, copies, point_chain, monkeypatch):
    """At the beginning of each of two kept turns, and before the chain is tried as it was, which the first asks for."""
    made, state = [], Turn._state
    monkeypatch.setattr(Turn, "_state", lambda turn: made.append(turn.index) or state(turn))
    values = (f"chain.gate={gate}", "chain.gate_margin=10", "chain.links=2", "chain.steps_per_turn=512")
    point_chain("tstar", *values)
    assert len(made) == copies


def flat(state: dict, prefix: str = "") -> dict:
    found = {}
    for name, value in state.items():
        inner = isinstance(value, dict)
        found |= flat(value, f"{prefix}{name}.") if inner else {f"{prefix}{name}": deepcopy(value)}
    return found
