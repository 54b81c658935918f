"""A skill that is cloned again from demonstrations which begin where the skill before ends."""

import pytest
import torch
from tensordict import TensorDict

from tstar_rl.chaining.turns import Turn
from tstar_rl.config import chain
from tstar_rl.demonstrations.data_set import Demonstrations

SHORT = ("skills=gail_ppo", "chain.steps_per_turn=512", "chain.trial_every=100", "bc.epochs=200")


def demonstrations(observations, action=0.0):
    """Of one step each."""
    n = len(observations)
    actions = torch.full((n, 9), action)
    ones, none = torch.ones(n, dtype=torch.int64), TensorDict({}, [n])
    where = ("table_lack", 0, "noisy", {}, ones, ones)
    return Demonstrations(*where, observations, actions, actions, ones.bool(), none)


@pytest.fixture
def asked(point_chain, monkeypatch):
    """Runs recipes/in_order.py; returns what the expert was asked for, and the turns as they began."""

    def run(*values):
        calls, turns = [], []

        def collect(make_env, episodes, kind, noise, seed):
            start = make_env(seed).reset()
            assert start["start_chained"].all()
            calls.append((episodes, kind, noise, start["observation"][:, 0]))
            return demonstrations(start["observation"][:episodes], action=0.5)

        rollouts = Turn.rollouts

        def watched(turn):
            skill = turn.skill
            said = skill.policy(TensorDict({"observation": turn.expert.observations}, []))["loc"]
            turns.append((turn.index, turn.expert, skill.normalizer.loc.clone(), said))
            yield from rollouts(turn)

        own = demonstrations(torch.rand(64, 72))
        monkeypatch.setattr(chain, "load_demonstrations", lambda config, subtask: own)
        monkeypatch.setattr(chain, "collect", collect)
        monkeypatch.setattr(Turn, "rollouts", watched)
        point_chain("in_order", *SHORT, *values)
        return calls, turns, own

    return run


def test_half_of_the_demonstrations_begin_where_the_skill_before_ends(asked):
    calls, turns, own = asked()
    assert [index for index, *_ in turns] == [0, 1, 2, 3]
    first = turns[0]
    assert first[1] is own and len(calls) == 3  # nothing comes before the first skill
    for index, (episodes, kind, noise, x) in enumerate(calls, start=1):
        assert (episodes, kind, noise) == (32, "noisy", 0.15)
        assert (x > index).all() and (x < index + 1).all()  # where subtask index - 1 is done
    for index, expert, mean, said in turns[1:]:
        assert len(expert) == 64 and torch.equal(expert.observations[:32], own.observations[:32])
        assert (expert.observations[32:, 0] > index).all() and (expert.actions[32:] == 0.5).all()
        assert mean[0] == pytest.approx(float(expert.observations[:, 0].mean()), abs=1e-4)
        made = said[32:].mean() - said[:32].mean()
        assert made > 0.2, "the clone tells the two kinds of starts apart"


def test_a_share_of_none_asks_for_none_and_one_that_cannot_be_is_refused(asked):
    calls, turns, own = asked("demonstrated_ends=0.0")
    assert not calls and all(expert is own for _, expert, *_ in turns)
    with pytest.raises(ValueError, match=r"must be in \[0, 1\], got 1.5"):
        asked("demonstrated_ends=1.5", "resume=false")
