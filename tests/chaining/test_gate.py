"""Trials of a chain and the gate that they decide, on a chain that trains in seconds."""

import math
from copy import deepcopy

import pandas as pd
import pytest
import torch
from point_chain import make_skills
from tensordict import TensorDict

from tstar_rl.chaining.calibration import area_under_curve
from tstar_rl.chaining.chain import load_chain
from tstar_rl.chaining.gate import Gate, GateSettings
from tstar_rl.chaining.paths import Path
from tstar_rl.chaining.skill import Skill
from tstar_rl.chaining.training import Training
from tstar_rl.chaining.trials import SkillTrial, Trial
from tstar_rl.chaining.turns import Turn

SHORT = ("chain.gate=false", "chain.steps_per_turn=512", "chain.trial_every=100")
"""Turns of one rollout, and no trial."""


@pytest.fixture
def skills(tmp_path) -> list[Skill]:
    make_skills(tmp_path)
    return [Skill.load(tmp_path / f"runs/table_lack/gail_ppo/seed0/subtask{i}/last") for i in range(4)]


class Chain:
    """Stands for a chain of two skills: its progress is a number, and its trials are noted.

    A trial takes 7 steps of skill 0 and 3 of skill 1.
    """

    def __init__(self, number: float) -> None:
        self.number, self.trials = number, []

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
        )


def of_progress(number: float) -> Trial:
    """Of 100 episodes in which skill 0 always succeeds."""
    before = torch.arange(100) < 100
    after = torch.arange(100) < round(200 * number - 100)
    nothing, states = torch.zeros(100, 0), TensorDict(batch_size=[0])
    path = Path(nothing[:0], torch.arange(0), torch.arange(0))
    return Trial(
        [
            SkillTrial(nothing, won, states, torch.arange(100), path, steps)
            for won, steps in ((before, 7), (after, 3))
        ]
    )


@pytest.mark.parametrize(("trained", "kept"), [(0.95, 0.95), (0.89, 0.89), (0.87, 0.9)])
def test_a_turn_that_lost_more_than_the_margin_is_put_back(trained, kept):
    chain = Chain(0.9)
    judgement = chain.turn(Gate(GateSettings(True, 0.02, 1), chain.run_trial), 0, trained)
    assert chain.number == kept and judgement.accepted == (kept == trained)
    assert judgement.kept.progress == pytest.approx(kept)


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


def test_without_rejections_a_trial_of_every_turn_begins_with_the_skill_that_was_trained():
    chain = Chain(0.75)
    gate = Gate(GateSettings(False, 0.0, 1), chain.run_trial)
    found = [chain.turn(gate, turn, trained) for turn, trained in enumerate((0.6, 0.8))]
    assert chain.trials == [(0.6, None, 0), (0.8, 0.6, 1)] and [each.steps for each in found] == [10, 3]
    resumed = Gate(GateSettings(False, 0.0, 1), chain.run_trial)
    assert chain.turn(resumed, 3, 0.9).steps == 3 and chain.trials[2:] == [(0.9, None, 1)]


def test_a_rejected_turn_puts_back_everything_that_it_changed(point_chain, monkeypatch):
    """Networks of the skill, d_omega of the next, both sets, and what the optimisers remember."""
    states = {}
    rollouts = Turn.rollouts

    def watched(turn):
        states["before", turn.run.turn] = turn._state()
        yield from rollouts(turn)
        states["after", turn.run.turn] = turn._state()

    def spoil(training, rollout):
        """The policy walks backwards: the chain gets nowhere."""
        if isinstance(training, Turn):
            training.skill.policy[0][1].module[0][-1].bias.data[0] = -1.0
        return finish(training, rollout)

    finish = Training._finish_rollout
    monkeypatch.setattr(Training, "_finish_rollout", spoil)
    monkeypatch.setattr(Turn, "rollouts", watched)
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


def flat(state: dict, prefix: str = "") -> dict:
    found = {}
    for name, value in state.items():
        inner = isinstance(value, dict)
        found |= flat(value, f"{prefix}{name}.") if inner else {f"{prefix}{name}": deepcopy(value)}
    return found


@pytest.mark.parametrize("seed_episodes", [0, 32])
def test_the_sets_begin_with_what_a_trial_of_the_chain_has_seen_or_empty(
    seed_episodes, point_chain, monkeypatch
):
    sizes = []
    rollouts = Turn.rollouts

    def watched(turn):
        if turn.run.turn == 0:
            sizes.extend((len(s.initiation_set), len(s.termination_set)) for s in turn.chain.skills)
        yield from rollouts(turn)

    monkeypatch.setattr(Turn, "rollouts", watched)
    point_chain("tstar", *SHORT, f"chain.seed_episodes={seed_episodes}")
    if not seed_episodes:
        assert sizes == [(0, 0)] * 4
    else:
        assert sizes[0] == (32, 32) and sizes[1] == sizes[2] == sizes[3] and 0 < sizes[1][0] < 32


def test_what_a_chain_carries_over_goes_on_after_a_kill(point_chain, monkeypatch, tmp_path):
    """A run that is killed in its second skill's second turn and resumed writes the same table as one that was not."""
    values = ("chain.gate=true", "chain.rounds=2", "chain.links=2", "chain.carry_over=true")
    whole = point_chain("tstar", *values, "system=whole")
    finish = Training._finish_rollout

    def killed(training, rollout):
        if training.run.turn == 3:
            raise KeyboardInterrupt
        return finish(training, rollout)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Training, "_finish_rollout", killed)
        point_chain("tstar", *values, "system=cut")
    resumed = point_chain("tstar", *values, "system=cut")
    pd.testing.assert_frame_equal(resumed, whole)
    places = [tmp_path / f"runs/table_lack/{system}/seed0/last" for system in ("whole", "cut")]
    for one, other in zip(*map(load_chain, places), strict=True):
        assert all(torch.equal(v, other.policy.state_dict()[k]) for k, v in one.policy.state_dict().items())


@pytest.mark.parametrize("carry_over", [True, False])
def test_optimisers_and_simulations_are_carried_over_or_made_anew(carry_over, point_chain, monkeypatch):
    seen = {}
    rollouts = Turn.rollouts

    def watched(turn):
        ids = seen.setdefault(turn.index, [])
        ids.append((id(turn.collection), turn.kept["update_policy"].updates))
        seen.setdefault("objects", []).append(turn.collection)  # so that no id is used twice
        yield from rollouts(turn)

    monkeypatch.setattr(Turn, "rollouts", watched)
    values = ("chain.links=2", "chain.rounds=2", f"chain.carry_over={str(carry_over).lower()}")
    point_chain("tstar", *SHORT, *values)
    for index in range(2):
        (first, none), (second, updates) = seen[index]
        assert (first == second) is carry_over and none == 0 and updates == (1 if carry_over else 0)


@pytest.mark.parametrize("d_omega_of", ["next", "own"])
def test_whose_d_omega_a_turn_trains(d_omega_of, point_chain, monkeypatch):
    table = point_chain("tstar", *SHORT, "chain.links=3", f"chain.d_omega_of={d_omega_of}")
    trained = table.dropna(subset=["d_omega_loss_discriminator"]).skill.unique().tolist()
    assert trained == ([0, 1] if d_omega_of == "next" else [1, 2])


@pytest.mark.parametrize("kept_states", ["all", "chained"])
def test_which_terminal_states_are_kept(kept_states, point_chain, monkeypatch):
    """Skill 1's own starts have y > 0.2. Where only chained starts count, a share of its ends has y below that."""
    counted = {}
    log = Turn.log

    def note(turn, rollout, row):
        won = rollout["next", "success"].squeeze(-1)
        chained = rollout["start_chained"].squeeze(-1) if turn.index else torch.ones_like(won)
        here = counted.setdefault(turn.index, [0, 0])
        here[0] += int((won & chained).sum())
        here[1] += int(won.sum())
        counted[turn.index, "added"] = turn.skill.termination_set.added
        log(turn, rollout, row)

    monkeypatch.setattr(Turn, "log", note)
    values = ("chain.links=2", "chain.seed_episodes=0", f"chain.kept_states={kept_states}")
    point_chain("tstar", "chain.gate=false", *values)
    for index in range(2):
        chained, won = counted[index]
        assert counted[index, "added"] == (won if kept_states == "all" else chained)
        assert chained == won if index == 0 else 0 < chained < won


def test_the_log_says_how_d_omega_does(point_chain):
    table = point_chain("tstar", "chain.gate=true", "chain.links=2", "d_omega.steps=256")
    ends = table.dropna(subset=["trial_progress"])
    assert ends.skill.tolist() == [0, 1] and (ends.trial_steps > 0).all()
    first = ends.iloc[0]
    assert first.handed == 64 and 0 < first.next_success < 1
    assert first.d_omega_auc > 0.9 and first.d_omega_sd > 0.05
    assert math.isnan(ends.iloc[1].d_omega_auc)


def test_a_d_omega_that_nothing_trains_is_not_judged(point_chain):
    table = point_chain("policy_sequencing", "chain.gate=true", "chain.links=2")
    assert "d_omega_auc" not in table and table.next_success.notna().sum() == 1


def test_area_under_curve_by_hand():
    # Successes .9 and .4, failures .5 and .4: of four pairs two are right, one is a tie, one is wrong.
    scores, outcomes = torch.tensor([0.9, 0.4, 0.5, 0.4]), torch.tensor([True, True, False, False])
    assert area_under_curve(scores, outcomes) == (2 + 0.5) / 4
    assert math.isnan(area_under_curve(scores, torch.ones(4, dtype=torch.bool)))
