"""Values of a chain's training that cannot be meant, for those who build one without a config."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from tstar_rl.chaining.chain_settings import ChainSettings
from tstar_rl.chaining.chain_training import ChainTraining
from tstar_rl.chaining.gate import Gate, GateSettings
from tstar_rl.checks import InvalidValueError

PLAIN = ChainSettings(
    rounds=1, seed_episodes=0, kept_states="all", d_omega_of="next", carry_over=True, order="forward",
    path_steps=0, logged_skill=0, logged_states=0,
)  # fmt: skip


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            {"order": "reverse"},
            "ChainSettings.order must be one of forward, backward, costliest; got 'reverse'",
        ),
        ({"d_omega_of": "nxt"}, "ChainSettings.d_omega_of must be one of next, own; got 'nxt'"),
        ({"kept_states": "al"}, "ChainSettings.kept_states must be one of all, chained; got 'al'"),
        ({"rounds": 0}, "ChainSettings.rounds must be at least 1, got 0"),
        ({"path_steps": -1}, "ChainSettings.path_steps must be not negative, got -1"),
        ({"logged_skill": 0.5}, "ChainSettings.logged_skill must be a whole number, got 0.5"),
    ],
)
def test_settings_of_turns(change, said):
    with pytest.raises(InvalidValueError, match=said):
        replace(PLAIN, **change)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ((True, float("nan"), 1), "GateSettings.margin must be a finite number, got nan"),
        ((True, 0.0, 0), "GateSettings.trial_every must be at least 1, got 0"),
    ],
)
def test_settings_of_the_gate(values, said):
    with pytest.raises(InvalidValueError, match=said):
        GateSettings(*values)


def a_chain(experts: int = 2, rollouts: int = 1, gate: tuple = (True, 0.0, 3), **settings) -> ChainTraining:
    skills, tried = [SimpleNamespace()] * 2, Gate(GateSettings(*gate), lambda known, first: known)
    shown = [SimpleNamespace()] * experts
    return ChainTraining(skills, shown, None, replace(PLAIN, **settings), rollouts, None, None, tried)  # pyright: ignore


def test_what_does_not_go_together():
    for values in ({"experts": 1}, {"rollouts": 0}):
        with pytest.raises(
            InvalidValueError, match="needs demonstrations for each skill and a rollout in each turn"
        ):
            a_chain(**values)
    with pytest.raises(
        InvalidValueError, match='order="costliest" needs a trial after every turn: .*; got 3'
    ):
        a_chain(order="costliest", gate=(False, 0.0, 3))
    for gate in ((True, 0.0, 3), (False, 0.0, 1)):
        assert a_chain(order="costliest", gate=gate).turn_order.skill_of(0) == 0
