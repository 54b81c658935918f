"""Updates of a recipe's own, on a chain that trains in seconds: saved, put back and carried over as ours are."""

import pandas as pd
import pytest
import torch

from tstar_rl.chaining.chain import load_chain
from tstar_rl.chaining.training import Training
from tstar_rl.chaining.turn_updates import TurnUpdates
from tstar_rl.checks import InvalidValueError
from tstar_rl.signal_equations import outcome_loss
from tstar_rl.updates import DiscriminatorSettings, DiscriminatorUpdate, LabelledSettings


class Counter:
    """Counts its rollouts. It draws weights, as an update with a network of its own does."""

    def __init__(self) -> None:
        self.count, self.network = 0, torch.nn.Linear(4, 4)

    def state_dict(self) -> dict[str, int]:
        return {"count": self.count}

    def load_state_dict(self, state_dict: dict[str, int]) -> None:
        self.count = state_dict["count"]


@pytest.fixture
def counters(monkeypatch) -> dict[int, list[Counter]]:
    """Makes every turn keep a counter, which each rollout moves on and the log shows; by skill, what turns got."""
    found: dict[int, list[Counter]] = {}
    policy_update, log = TurnUpdates.policy_update, Training.log

    def with_counter(turn):
        found.setdefault(turn.index, []).append(turn.keep("counter", Counter))
        return policy_update(turn)

    def counted(training, rollout, row):
        counter = found[training.index][-1]
        counter.count += 1
        log(training, rollout, {**row, "counted": counter.count})

    monkeypatch.setattr(TurnUpdates, "policy_update", with_counter)
    monkeypatch.setattr(Training, "log", counted)
    return found


def test_it_goes_on_in_the_skills_next_turn_and_after_a_kill(counters, whole_and_resumed):
    whole, resumed = whole_and_resumed(
        "policy_sequencing", "chain.gate=false", "chain.links=2", "chain.rounds=2", "chain.carry_over=true"
    )
    assert whole.counted.tolist() == [1, 1, 2, 2]
    pd.testing.assert_frame_equal(resumed, whole)


def test_a_turn_that_is_put_back_puts_it_back(counters, point_chain, spoiled_turns):
    log = point_chain(
        "policy_sequencing", "chain.gate=true", "chain.links=2", "chain.rounds=2", "chain.carry_over=true"
    )
    assert (log.accepted.dropna() == 0).all() and log.counted.max() > 0
    for turns in counters.values():
        assert len(turns) == 2 and turns[0] is turns[1] and turns[0].count == 0


def test_networks_that_a_turn_trains_of_any_skill_are_put_back(point_chain, monkeypatch, tmp_path):
    policy_update, finish = TurnUpdates.policy_update, Training._finish_rollout

    def with_network(turn):
        if turn.previous is not None:
            settings = DiscriminatorSettings()
            turn.discriminator_update("further", turn.previous, settings, initiation=1.0, termination=0.0)
        return policy_update(turn)

    def spoil(turn, rollout):
        turn.skill.policy[0][1].module[0][-1].bias.data[0] = -1.0  # it walks backwards
        if turn.previous is not None:
            for values in turn.previous.network("further").parameters():
                values.data.fill_(7.0)
        return finish(turn, rollout)

    monkeypatch.setattr(TurnUpdates, "policy_update", with_network)
    monkeypatch.setattr(Training, "_finish_rollout", spoil)
    log = point_chain("policy_sequencing", "chain.gate=true", "chain.links=2", "system=spoiled")
    assert (log.accepted.dropna() == 0).all()
    first, _ = load_chain(tmp_path / "runs/table_lack/spoiled/seed0/last")
    assert not any(bool((values == 7.0).all()) for values in first.network("further").parameters())


@pytest.mark.parametrize("carry_over", ["true", "false"])
def test_one_may_train_a_network_of_the_skill_that_has_its_name(monkeypatch, whole_and_resumed, carry_over):
    """One of the library's kind, too; in a second turn of the skill and in a run that goes on the network is there."""
    policy_update, got = TurnUpdates.policy_update, []

    def with_network(turn):
        def make():
            network = turn.skill.add_network("mine")
            return DiscriminatorUpdate("mine", network, LABELS, DiscriminatorSettings(), turn.seed)

        got.append(turn.keep("mine", make))
        return policy_update(turn)

    monkeypatch.setattr(TurnUpdates, "policy_update", with_network)
    whole, resumed = whole_and_resumed(
        "policy_sequencing",
        "chain.gate=false",
        "chain.links=2",
        "chain.rounds=2",
        f"chain.carry_over={carry_over}",
    )
    pd.testing.assert_frame_equal(resumed, whole)
    assert (got[0] is got[2]) == (carry_over == "true")


@pytest.mark.parametrize("name", ["policy", "f_phi"])
def test_a_name_of_an_update_that_is_there_is_refused(point_chain, monkeypatch, name):
    monkeypatch.setattr(TurnUpdates, "policy_update", lambda turn: turn.keep(name, Counter))
    with pytest.raises(InvalidValueError, match=f"{name} has an update of the library's"):
        point_chain("policy_sequencing", "chain.gate=false", "chain.links=2")


def test_the_policys_update_is_not_handed_out_for_ones_own(point_chain, monkeypatch):
    policy_update = TurnUpdates.policy_update

    def after_it(turn):
        policy_update(turn)
        return turn.keep("policy", Counter)

    monkeypatch.setattr(TurnUpdates, "policy_update", after_it)
    with pytest.raises(InvalidValueError, match="policy has an update of the library's"):
        point_chain("policy_sequencing", "chain.gate=false", "chain.links=2")


def test_a_network_called_as_an_update_of_ones_own_is_refused(point_chain, monkeypatch):
    def both(turn):
        turn.keep("further", Counter)
        turn.discriminator_update(
            "further", turn.skill, DiscriminatorSettings(), initiation=1.0, termination=0.0
        )

    monkeypatch.setattr(TurnUpdates, "policy_update", both)
    with pytest.raises(
        InvalidValueError, match="update_further is a Counter already, not a DiscriminatorUpdate"
    ):
        point_chain("policy_sequencing", "chain.gate=false", "chain.links=2")


LABELS = {"initiation": 1.0, "termination": 0.0}


@pytest.mark.parametrize(
    "again, message",
    [
        (lambda turn: turn.keep("further", Counter), "it is the library's update of a network"),
        (
            lambda turn: turn.labelled_update("further", turn.previous, outcome_loss, LabelledSettings()),
            "update_further is a DiscriminatorUpdate already, not a LabelledUpdate",
        ),
        (
            lambda turn: turn.discriminator_update(
                "further", turn.previous, DiscriminatorSettings(steps=3), **LABELS
            ),
            r"update_further goes on with .*steps=100.*, got .*steps=3.*: .*chain.carry_over=false",
        ),
        (
            lambda turn: turn.discriminator_update(
                "further", turn.previous, DiscriminatorSettings(), termination=0.0, initiation=1.0
            ),
            "update_further goes on with labels {'initiation': 1.0, 'termination': 0.0}, got {'termination'",
        ),
        (
            lambda turn: turn.discriminator_update("further", turn.skill, DiscriminatorSettings(), **LABELS),
            "a turn has one update of further, and it is of another skill than 1",
        ),
    ],
)
def test_an_update_that_goes_on_is_not_handed_out_for_another(point_chain, monkeypatch, again, message):
    def twice(turn):
        if turn.previous is not None:
            turn.discriminator_update("further", turn.previous, DiscriminatorSettings(), **LABELS)
            again(turn)
        return policy_update(turn)

    policy_update = TurnUpdates.policy_update
    monkeypatch.setattr(TurnUpdates, "policy_update", twice)
    with pytest.raises(InvalidValueError, match=message):  # in the first turn, that of skill 1
        point_chain("policy_sequencing", "chain.gate=false", "chain.links=2", "chain.order=backward")


def test_what_has_no_state_is_refused(point_chain, monkeypatch):
    monkeypatch.setattr(TurnUpdates, "policy_update", lambda turn: turn.keep("mine", lambda: torch.zeros(1)))
    with pytest.raises(InvalidValueError, match=r"keep\('mine'\) takes .* state_dict .*; Tensor lacks one"):
        point_chain("policy_sequencing", "chain.gate=false", "chain.links=2")


def test_an_update_that_is_made_after_the_first_rollout_is_refused(point_chain, monkeypatch):
    """A run that is resumed would go on with a fresh one, and the gate would not put it back."""
    log = Training.log

    def late(training, rollout, row):
        settings = DiscriminatorSettings()
        training.discriminator_update("further", training.skill, settings, initiation=1.0, termination=0.0)
        log(training, rollout, row)

    monkeypatch.setattr(Training, "log", late)
    with pytest.raises(
        InvalidValueError, match=r"update_further is made after the first rollout, .*make it before"
    ):
        point_chain("policy_sequencing", "chain.gate=false", "chain.links=2")


def test_a_floor_that_a_network_was_not_made_with_is_told(point_chain, monkeypatch):
    """Asked for before the update that gives it, a network would be without its floor, and nobody would know."""
    policy_update = TurnUpdates.policy_update

    def asked_for_before(turn):
        turn.skill.add_network("further")
        with pytest.raises(InvalidValueError, match="has a floor of None, and 0.02 is asked for"):
            turn.skill.add_network("further", 0.02)
        another = turn.skill.add_network("another", 0.02)
        assert turn.skill.add_network("another", 0.02) is another is turn.skill.network("another")
        with pytest.raises(InvalidValueError, match="every skill has its own sets"):
            turn.skill.add_network("sets")
        return policy_update(turn)

    monkeypatch.setattr(TurnUpdates, "policy_update", asked_for_before)
    point_chain("policy_sequencing", "chain.gate=false", "chain.links=2", "chain.steps_per_turn=512")


def test_a_networks_loss_is_the_same_in_every_turn(point_chain, monkeypatch):
    """That of the first turn would go on, and another not be heard of."""

    def taught(turn):
        turn.labelled_update("further", turn.skill, lambda said, label: said.sum(), LabelledSettings())
        return policy_update(turn)

    policy_update = TurnUpdates.policy_update
    monkeypatch.setattr(TurnUpdates, "policy_update", taught)
    with pytest.raises(
        InvalidValueError, match="update_further goes on with the distance of the skill's last turn"
    ):
        short = ("chain.steps_per_turn=512", "chain.trial_every=100", "chain.seed_episodes=0")
        point_chain("policy_sequencing", "chain.gate=false", "chain.links=2", "chain.rounds=2", *short)
