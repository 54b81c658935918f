"""A signal that nothing has taught, or that has no unit, pays nothing, and the run says so."""

import pytest

from tstar_rl.chaining.turns import Turn
from tstar_rl.checks import InvalidValueError

SHORT = ("chain.gate=false", "chain.steps_per_turn=512", "chain.trial_every=100")
"""Turns of one rollout, and no trial."""


def test_a_signal_that_reads_a_network_which_nothing_trains_is_told(point_chain, monkeypatch, capsys):
    once_learned = Turn.once_learned

    def reads(name, make):
        def asked(turn, _, skill):
            if make:
                skill.add_network(name)
            return once_learned(turn, name, skill)

        monkeypatch.setattr(Turn, "once_learned", asked)

    point_chain("tstar", *SHORT, "chain.links=2")
    assert "to be taught as a signal" not in capsys.readouterr().out
    reads("further", make=True)
    point_chain("tstar", *SHORT, "chain.links=2", "system=further")
    told = "1/further (skill/network): this network was to be taught as a signal, and no turn"
    assert told in capsys.readouterr().out
    reads("d_omgea", make=False)
    with pytest.raises(InvalidValueError, match="skill 1 has no network 'd_omgea'.* did you mean d_omega"):
        point_chain("tstar", *SHORT, "chain.links=2", "system=misspelled")


@pytest.mark.parametrize(
    ("recipe", "term", "values"),
    [
        ("proximity", "reward_proximity", ("chain.path_steps=8",)),
        ("feasibility", "reward_tsr", ("chain.kept_states=chained",)),
    ],
)
def test_a_signal_that_no_trial_has_taught_is_told(point_chain, capsys, recipe, term, values):
    """P learns from trials alone, F from the next skill's turns too, of which there is none before."""
    untried = (
        "chain.links=2",
        "chain.rounds=1",
        "chain.gate=false",
        "chain.trial_every=100",
        "chain.seed_episodes=0",
    )
    logged = point_chain(recipe, *SHORT, *untried, *values)
    assert term not in logged or logged[term].isna().all()
    assert f"1/{recipe} (skill/network): this network was to be taught as a signal" in capsys.readouterr().out


def test_a_critic_without_a_unit_pays_nothing_and_that_is_told(point_chain, capsys):
    logged = point_chain(
        "hand_over_value", *SHORT, "chain.links=2", "chain.rounds=1", "chain.seed_episodes=0"
    )
    assert "reward_tsr" not in logged or logged["reward_tsr"].isna().all()
    assert "skill 1: its critic has no unit yet, so skill 0 is paid nothing" in capsys.readouterr().out
