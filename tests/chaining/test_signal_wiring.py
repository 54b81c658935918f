"""What signals beyond the paper's learn from, are judged by and pay, read where the numbers pass, on a point."""

from types import SimpleNamespace

import pytest
import torch
from torch.testing import assert_close

from tstar_rl.chaining import turn_updates, turns
from tstar_rl.chaining.chain_training import ChainTraining
from tstar_rl.chaining.signals import value_scale
from tstar_rl.chaining.skill import Skill
from tstar_rl.chaining.turns import Turn
from tstar_rl.checks import InvalidValueError

TWO = ("chain.gate=false", "chain.links=2")
SHORT = ("chain.gate=false", "chain.steps_per_turn=512", "chain.trial_every=100")
"""Turns of one rollout, and no trial."""
CRITIC = ("chain.order=backward", "ppo.critic_learning_rate=1e-2", "ppo.epochs=4")
"""What a critic needs to learn within a few rollouts of three steps an episode."""


def test_a_proximity_that_has_not_learned_is_not_paid(point_chain):
    """Trials before the first turn are what P learns from."""
    own = (*TWO, "chain.trial_every=100", "chain.steps_per_turn=512", "chain.path_steps=8")
    seeded, none = (
        point_chain("proximity", *own, f"chain.seed_episodes={number}", f"system=after_{number}")
        for number in (64, 0)
    )
    assert seeded["reward_proximity"].notna().any() and "proximity_loss" in seeded
    assert not {"reward_proximity", "proximity_loss"} & set(none)


def test_an_f_that_has_not_learned_is_not_paid_nor_judged(point_chain):
    """Without a run of the chain before the first turn, F learns in the turns of the next skill and their trials."""
    table = point_chain(
        "feasibility", "chain.gate=false", "chain.links=2", "chain.rounds=2", "chain.seed_episodes=0"
    )
    first, second = (table[(table.skill == 0) & (table["round"] == round_)] for round_ in range(2))
    paid = ["reward_tsr", "feasibility_loss", "feasibility_auc"]
    assert first[paid].isna().all(None) and second["reward_tsr"].notna().all()
    assert second["feasibility_brier"].notna().any()


def test_a_signal_that_says_nothing_of_a_state_is_refused_before_the_turn():
    turn = SimpleNamespace(signals={})
    with pytest.raises(
        InvalidValueError, match=r"turn.signal\('odd'\) takes what has said\(obs\).*; Linear has none"
    ):
        Turn.signal(turn, "odd", torch.nn.Linear(1, 1))
    with pytest.raises(
        InvalidValueError, match=r"turn.signal\('odd'\): label must be one of success, share; got 'shares'"
    ):
        Turn.signal(turn, "odd", SimpleNamespace(said=None), label="shares")
    assert not turn.signals


def test_f_learns_the_share_that_the_config_asks_for(point_chain, monkeypatch):
    """The label of a chain whose third skill never succeeds: 1 or 0 for success, 1/2 or 0 for the share."""
    asked = {}
    keep = ChainTraining.keep_outcomes

    def lost(chain, trial, rejected=None):
        trial.skills[2].succeeded.fill_(False)
        keep(chain, trial, rejected)

    log = Turn.log

    def note(turn, rollout, row):
        if turn.index == 0:
            asked[label] = turn.following.outcomes.labels(label).unique().tolist()
        log(turn, rollout, row)

    monkeypatch.setattr(ChainTraining, "keep_outcomes", lost)
    monkeypatch.setattr(Turn, "log", note)
    means = {}
    for label in ("success", "share"):
        table = point_chain("feasibility", *SHORT, "chain.links=3", f"label={label}", f"system={label}")
        means[label] = table[table.skill == 0].feasibility_label.iloc[0]
    assert asked == {"success": [0, 1], "share": [0, 0.5]}
    assert means["share"] == pytest.approx(means["success"] / 2)


def test_a_turn_estimates_the_rest_of_the_chain_by_the_next_skills_f(point_chain, monkeypatch):
    """A success of skill 1 of three is half of what is left; F of skill 2 says how much of the other half follows."""
    added = []
    outcomes = Turn.outcomes

    def watched(turn, rollout, later):
        found = outcomes(turn, rollout, later)
        ended = turn.chained(rollout)["next"]
        ended = ended[ended["done"].squeeze(-1)]["observation"]
        said = turn.following.network("feasibility")(ended) if turn.following else torch.zeros(len(ended), 1)
        added.append((turn.index, *found[1:], None if later is None else said.detach().sigmoid().squeeze(-1)))
        return found

    monkeypatch.setattr(Turn, "outcomes", watched)
    point_chain("feasibility", *SHORT, "chain.links=3")
    assert [index for index, *_ in added] == [0, 1, 2]
    for index, succeeded, share, feasible in added:
        left = 3 - index
        assert succeeded.any() and (feasible is None) == (index == 2)
        rest = torch.zeros_like(share) if feasible is None else (left - 1) * feasible
        assert_close(share, succeeded * (1 + rest) / left)


def test_a_signal_for_the_share_is_judged_by_the_share_from_the_next_skill_on(
    point_chain, monkeypatch, tmp_path
):
    """Of two skills after skill 0 one is done where the first succeeds: skill 2 walks backwards."""
    place = tmp_path / "runs/table_lack/gail_ppo/seed0/subtask2/last"
    lost = Skill.load(place)
    lost.policy[0][1].module[0][-1].bias.data[0] = -1.0
    lost.save(place)
    judged, judge = [], turns.judge

    def watched(name, signal, handed, succeeded, outcome):
        judged.append((succeeded.double(), outcome))
        return judge(name, signal, handed, succeeded, outcome)

    monkeypatch.setattr(turns, "judge", watched)
    point_chain("feasibility", "chain.gate=false", "chain.steps_per_turn=512", "chain.links=3", "label=share")
    (succeeded, outcome), *_ = judged
    assert 0 < succeeded.mean() < 1 and torch.equal(outcome, succeeded / 2)


def test_a_critics_error_and_the_value_paid_are_in_the_units_of_the_skill_they_are_of(
    point_chain, monkeypatch
):
    """Rewards are divided by the deviation of the skill's returns; the value that counts as 1 is the next skill's."""
    scales, errors = [], []
    critic_errors = turn_updates.critic_errors

    def watched(rollout, skill, gamma, unit, scale):
        errors.append((unit, float(skill.return_scale.deviation), scale, value_scale(skill)))
        return critic_errors(rollout, skill, gamma, unit, scale)

    signal = Turn.signal

    def noted(turn, name, given, label="success"):
        scales.append((given.scale, value_scale(turn.following)))
        return signal(turn, name, given, label)

    monkeypatch.setattr(turn_updates, "critic_errors", watched)
    monkeypatch.setattr(Turn, "signal", noted)
    point_chain("hand_over_value", *SHORT, "chain.links=2", "chain.rounds=2", *CRITIC)
    assert all(given == pytest.approx(expected) for given, expected in scales) and scales[-1][1] != 1.0
    assert all(unit == deviation for unit, deviation, *_ in errors)
    assert (
        len(errors) >= 3
    )  # of four rollouts: in a skill's first its critic, which learned nothing, may have no unit
    assert errors[-1][0] != 1.0  # that of a first rollout is
    assert all(scale == pytest.approx(expected) for *_, scale, expected in errors)


def test_starts_of_the_next_skills_turns_join_its_outcomes(point_chain, monkeypatch):
    """In the turn of skill 1: those that began where skill 0 ends, failed ones too."""
    seen = []
    log = Turn.log

    def note(turn, rollout, row):
        if turn.index == 1:
            ended = rollout["next", "done"].squeeze(-1) & rollout["start_chained"].squeeze(-1)
            seen.append((int(ended.sum()), len(turn.skill.outcomes)))
        log(turn, rollout, row)

    monkeypatch.setattr(Turn, "log", note)
    point_chain("feasibility", *TWO, "chain.trial_every=100")
    (_, first), (number, second) = seen
    assert second - first == number > 20
