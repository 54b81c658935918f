"""A skill that is cloned again from demonstrations which begin where the skill before ends."""

import shutil

import pytest
import torch
from hydra import compose, initialize_config_dir
from tensordict import TensorDict

from tstar_rl.chaining.chain import load_chain
from tstar_rl.chaining.turns import Turn
from tstar_rl.checks import InvalidValueError
from tstar_rl.config import chain, load
from tstar_rl.config.values import CONFIGS
from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.rollouts.state_sets import TerminationSet

SHORT = ("chain.steps_per_turn=512", "chain.trial_every=100", "bc.epochs=200")


def demonstrations(observations, action=0.0):
    """Of one step each."""
    n = len(observations)
    actions = torch.full((n, 9), action)
    ones, none = torch.ones(n, dtype=torch.int64), TensorDict({}, [n])
    where = ("table_lack", 0, "noisy", {}, ones, ones)
    return Demonstrations(*where, observations, actions, actions, ones.bool(), none)


@pytest.fixture
def asked(point_chain, monkeypatch, tmp_path):
    """Runs a recipe on the point's skills, as clones.

    Returns what the expert was asked for, the turns as they began, and the old demonstrations.
    """

    made = tmp_path / "runs/table_lack"
    shutil.move(made / "gail_ppo", made / "bc")

    def run(recipe, *values):
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

        own = demonstrations(torch.rand(64, 72, generator=torch.Generator().manual_seed(0)))
        monkeypatch.setattr(chain, "load_demonstrations", lambda config, subtask: own)
        monkeypatch.setattr(chain, "collect", collect)
        monkeypatch.setattr(Turn, "rollouts", watched)
        point_chain(recipe, *SHORT, *values)
        return calls, turns, own

    return run


@pytest.mark.parametrize("recipe", ["in_order", "in_order_cloned"])
def test_half_of_the_demonstrations_begin_where_the_skill_before_ends(asked, recipe):
    calls, turns, own = asked(recipe)
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


def test_what_is_cloned_again_forgets_where_its_old_clone_ended(asked, monkeypatch):
    sizes, clone = [], Turn.clone_from_ends

    def watched(turn, *given):
        before = len(turn.skill.termination_set)
        clone(turn, *given)
        sizes.append((before > 0, len(turn.skill.termination_set)))

    monkeypatch.setattr(Turn, "clone_from_ends", watched)
    calls, *_ = asked("in_order_cloned")
    first, *cloned = sizes
    assert first == (True, 64), (
        "the first skill is not cloned again: all 64 episodes before the first turn end there"
    )
    assert [old for old, _ in cloned] == [True] * 3 and [left for _, left in cloned] == [0] * 3
    assert len(calls) == 3, "each turn has filled its set for the next skill"


def test_after_a_clone_that_never_succeeded_the_next_skill_has_its_own_starts_alone(asked, monkeypatch):
    """What the second skill adds is dropped, so that its set is empty after its turn. The third is not cloned then."""
    extend = TerminationSet.extend_from
    monkeypatch.setattr(TerminationSet, "extend_from", lambda kept, rows: len(kept) and extend(kept, rows))
    calls, turns, own = asked("in_order")
    assert [index for index, *_ in turns] == [0, 1, 2, 3]
    assert [expert is own for _, expert, *_ in turns] == [True, False, True, False] and len(calls) == 2


def test_the_smallest_share_asks_for_one(asked):
    calls, *_ = asked("in_order", "demonstrated_ends=0.001")
    assert [episodes for episodes, *_ in calls] == [1, 1, 1]


def test_a_share_of_none_asks_for_none_and_one_that_cannot_be_is_refused(asked):
    calls, turns, own = asked("in_order", "demonstrated_ends=0.0")
    assert not calls and all(expert is own for _, expert, *_ in turns)
    with pytest.raises(ValueError, match=r"must be in \[0, 1\], got 1.5"):
        asked("in_order", "demonstrated_ends=1.5", "resume=false")


@pytest.mark.parametrize("scale", ["no_return", "laptop", "narrow"])
def test_the_critic_of_a_clone_warms_up_for_as_many_steps_as_in_a_first_training(scale):
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/in_order", [f"scale={scale}"])
    steps = config.chain.horizon * config.chain.ppo.critic_warmup
    assert steps == config.training.horizon * config.ppo.critic_warmup > 0


def test_turns_in_which_no_policy_would_be_trained_are_refused(asked):
    """A turn of a rollout, and one round; or more, each of which begins anew."""
    warm_up, anew = (
        "chain.ppo.critic_warmup=1",
        ("demonstrated_ends=0", "chain.rounds=4", "chain.carry_over=false"),
    )
    for values in ((), anew):
        with pytest.raises(
            InvalidValueError, match="1 turns of a skill have 1 rollouts, .* from the first 1"
        ):
            asked("in_order", warm_up, *values, "resume=false")


@pytest.mark.parametrize(("recipe", "learns"), [("in_order", True), ("in_order_cloned", False)])
def test_only_one_of_the_two_recipes_learns_from_rewards(asked, tmp_path, recipe, learns):
    _, turns, _ = asked(recipe, "chain.ppo.critic_warmup=0")
    chain = load_chain(tmp_path / f"runs/table_lack/{recipe}/seed0/last")
    for index, expert, _, cloned in turns:
        trained = chain[index].policy(TensorDict({"observation": expert.observations}, []))["loc"]
        assert torch.equal(trained, cloned) != learns


@pytest.fixture
def asked_by_ones_own(asked, monkeypatch):
    """`asked`, as by a recipe of a user's own, whose config is not checked for what it reads."""
    monkeypatch.setattr(load, "check_what_is_not_read", lambda *_: None)
    return asked


def test_a_gate_does_not_go_with_clones_made_in_a_turn(asked_by_ones_own):
    with pytest.raises(ValueError, match=r"set chain\.gate=false"):
        asked_by_ones_own("in_order", "chain.gate=true", "chain.trial_episodes=4")


def test_nor_does_a_normaliser_that_runs_on(asked_by_ones_own):
    with pytest.raises(ValueError, match=r"set normalizer\.running=false"):
        asked_by_ones_own("in_order", "normalizer.running=true")


@pytest.mark.parametrize(
    "values",
    [("chain.rounds=2",), ("chain.order=costliest", "chain.trial_every=1", "chain.trial_episodes=4")],
)
def test_a_second_turn_does_not_clone_over_the_first(asked_by_ones_own, values):
    """By cost, a skill can have two turns of four, and another one none."""
    with pytest.raises(ValueError, match=r"set chain\.rounds=1 and chain\.order=forward, got"):
        asked_by_ones_own("in_order", *values)


def test_where_nothing_is_cloned_skills_have_gates_and_turns(asked):
    values = (
        "demonstrated_ends=0.0",
        "chain.gate=true",
        "chain.trial_every=1",
        "chain.rounds=2",
        "chain.trial_episodes=4",
    )
    calls, turns, _ = asked("in_order", *values)
    assert not calls and [index for index, *_ in turns] == [0, 1, 2, 3] * 2


def test_a_clone_is_fitted_with_the_floor_that_is_asked_for(asked, tmp_path):
    asked("in_order_cloned", "normalizer.floor=0.7")
    _, *cloned = load_chain(tmp_path / "runs/table_lack/in_order_cloned/seed0/last")
    assert [skill.normalizer.floor_found() for skill in cloned] == pytest.approx([0.7] * 3)
