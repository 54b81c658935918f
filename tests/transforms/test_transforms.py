"""What each transform does; the contract that all of them meet is in `test_transform_contract.py`."""

import math

import pytest
import torch
from tensordict import TensorDict
from torch.testing import assert_close
from torchrl.envs import Compose, TransformedEnv
from transform_parts import FixedStarts, Slot

from tstar_rl.chaining.signals import OnceLearned
from tstar_rl.transforms import (
    ConstantBonus,
    EpisodeStart,
    FeasibilityReward,
    GAILReward,
    HandOverValueReward,
    ProximityReward,
    RewardMixture,
    SkillChainReset,
    TerminalStateReward,
    weighted,
)


def steps(observation, following, success=(False, False), **rewards):
    """Two steps: observations of one number each."""

    def column(values):
        return torch.tensor(values).unsqueeze(-1)

    after = {"observation": column(following), "success": column(success)}
    after.update({name: column(values) for name, values in rewards.items()})
    return TensorDict({"observation": column(observation), "next": TensorDict(after, [2])}, [2])


def test_gail_reward_scores_the_state_that_is_left():
    batch = steps([0.0, 1.0], [3.0, 2.0])
    assert_close(GAILReward(Slot())(batch)["next", "reward_gail"], torch.tensor([[0.75], [1.0]]))


def test_terminal_state_reward_is_paid_on_success_alone():
    batch = steps([0.1, 0.2], [0.6, 0.7], success=(False, True))
    assert_close(TerminalStateReward(Slot())(batch)["next", "reward_tsr"], torch.tensor([[0.0], [0.7]]))
    before = TerminalStateReward(Slot(), score="before")(batch)
    assert_close(before["next", "reward_tsr"], torch.tensor([[0.0], [0.2]]))
    constant = TerminalStateReward(ConstantBonus(0.45))(batch)
    assert_close(constant["next", "reward_tsr"], torch.tensor([[0.0], [0.45]]))


def test_feasibility_is_paid_on_success_alone():
    batch = steps([5.0, 5.0], [math.log(3.0), math.log(3.0)], success=(False, True))  # F is 3/4 at log 3
    found = FeasibilityReward(Slot())(batch.clone())
    assert_close(found["next", "reward_tsr"], torch.tensor([[0.0], [0.75]]))
    centred = FeasibilityReward(Slot(), baseline="running_mean")(batch)  # a first success sets the mean
    assert_close(centred["next", "reward_tsr"], torch.tensor([[0.0], [0.0]]))


def test_a_hand_over_is_paid_the_next_value_as_far_as_it_is_sure():
    batch = steps([0.0, 0.0], [1.0, 1.0], success=(False, True))
    trusted = HandOverValueReward(Slot(), None, alpha=4.0, scale=2.0)(batch.clone())
    assert_close(
        trusted["next", "reward_tsr"], torch.tensor([[0.0], [0.5]])
    )  # a value of 1, where 2 counts as 1

    def error(obs):
        return torch.full_like(obs[:, :1], 0.125)

    doubted = HandOverValueReward(Slot(), error, alpha=4.0, scale=2.0)(batch)
    assert_close(doubted["next", "reward_tsr"], torch.tensor([[0.0], [0.25]]))  # half the trust is left


def test_proximity_pays_each_step_and_the_end_once_more():
    found = ProximityReward(Slot())(steps([0.25, 0.75], [0.5, 0.5], success=(False, True)))
    assert_close(found["next", "reward_proximity"], torch.tensor([[0.25], [0.25]]))  # .5 - .75 + .5


def test_running_mean_is_subtracted_and_saved():
    transform = TerminalStateReward(Slot(), baseline="running_mean", momentum=0.5)
    # The first two successes set the mean to 0.4; the next, of 0.8, moves it half way to 0.6 and is paid 0.2.
    first = transform(steps([0.0, 0.0], [0.2, 0.6], success=(True, True)))
    assert_close(first["next", "reward_tsr"], torch.tensor([[-0.2], [0.2]]))
    second = steps([0.0, 0.0], [0.8, 0.9], success=(True, False))
    copy = TerminalStateReward(Slot(), baseline="running_mean", momentum=0.5)
    copy.load_state_dict(transform.state_dict())
    for each in (transform, copy):
        assert_close(each(second.clone())["next", "reward_tsr"], torch.tensor([[0.2], [0.0]]))


def test_a_later_batch_of_successes_moves_the_mean_by_the_weight_of_all_of_them():
    transform = TerminalStateReward(Slot(), baseline="running_mean", momentum=0.5)
    transform(steps([0.0, 0.0], [0.4, 0.9], success=(True, False)))  # the first sets the mean to .4
    paid = transform(steps([0.0, 0.0], [0.6, 1.0], success=(True, True)))  # .4 + (1 - .5 ** 2) (.8 - .4) = .7
    assert_close(paid["next", "reward_tsr"], torch.tensor([[-0.1], [0.3]]))


def test_a_simulation_that_takes_no_step_is_paid_nothing_again(make_env):
    """It still stands where it succeeded; TorchRL's "_step" says that the others go on."""
    transform = TerminalStateReward(Slot(), baseline="running_mean", momentum=1.0)
    before = steps([0.2, 0.2], [0.5, 0.25], success=(True, True))
    transform._step(before.exclude("next"), before["next"])
    assert transform.successes == 2 and transform.mean == pytest.approx(0.375)
    again = steps([0.5, 0.25], [0.5, 0.75], success=(True, True)).set("_step", torch.tensor([False, True]))
    paid = transform._step(again.exclude("next"), again["next"])["reward_tsr"]
    assert transform.successes == 3 and transform.mean == pytest.approx(0.75)
    assert_close(paid, torch.zeros(2, 1))
    mixture = RewardMixture({"tsr": 1.0})
    again["next", "reward_tsr"] = torch.ones(2, 1)
    paid = mixture._step(again.exclude("next"), again["next"])["reward"].squeeze(-1)
    assert paid[0] == 0 and paid[1] != 0


def test_mixture_sums_once_and_prints_its_weights():
    mixture = RewardMixture({"env": 0.5, "gail": 0.25, "tsr": 100.0}, 0.1, scales={"gail": 2.0})
    assert mixture.effective_weights() == pytest.approx(
        {"reward_env": 0.05, "reward_gail": 0.05, "reward_tsr": 10.0}
    )
    assert repr(mixture) == "RewardMixture(reward = 0.05 reward_env + 0.05 reward_gail + 10 reward_tsr)"
    batch = steps(
        [0.0, 0.0], [0.0, 0.0], reward_env=[4.0, 0.0], reward_gail=[1.0, 1.0], reward_tsr=[0.0, 0.5]
    )
    assert_close(mixture(batch)["next", "reward"], torch.tensor([[0.25], [5.05]]))


def test_mixture_reads_only_what_counts():
    batch = steps([0.0, 0.0], [0.0, 0.0], reward_env=[4.0, 2.0])
    assert_close(
        RewardMixture({"env": 0.5, "gail": 0.0})(batch.clone())["next", "reward"],
        torch.tensor([[0.1], [0.05]]),
    )
    with pytest.raises(
        KeyError, match="RewardMixture needs 'reward_gail'; got only observation, reward_env, success"
    ):
        RewardMixture({"env": 0.5, "gail": 0.5})(batch)


def test_the_whole_stack_in_an_env(make_env, policy):
    stack = Compose(
        EpisodeStart(),
        GAILReward(Slot()),
        TerminalStateReward(Slot()),
        RewardMixture({"env": 0.5, "gail": 0.5, "tsr": 10.0}, reward_scale=1.0),
    )
    rollout = TransformedEnv(make_env(), stack).rollout(6, policy, break_when_any_done=False)
    after = rollout["next"]
    expected = 0.5 * after["reward_env"] + 0.5 * after["reward_gail"] + 10.0 * after["reward_tsr"]
    assert_close(after["reward"], expected)
    assert (after["reward_tsr"][after["success"]] == 1).all() and after["success"].any()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: TerminalStateReward(Slot(), score="mean"), "'terminal' or 'before', got 'mean'"),
        (lambda: TerminalStateReward(Slot(), baseline="mean"), "'none' or 'running_mean', got 'mean'"),
        (lambda: TerminalStateReward(Slot(), momentum=0.0), r"\(0, 1\], got 0.0"),
        (lambda: FeasibilityReward(OnceLearned(Slot(), bool)), "a classifier's raw 0 is a chance of .5"),
        (lambda: FeasibilityReward(Slot(), score="mean"), "'terminal' or 'before', got 'mean'"),
        (
            lambda: HandOverValueReward(Slot(), None, -1.0, 1.0),
            "alpha must not be negative.* got -1.0 and 1.0",
        ),
        (lambda: HandOverValueReward(Slot(), None, 1.0, 0.0), "scale positive, .* got 1.0 and 0.0"),
        (lambda: HandOverValueReward(Slot(), None, float("nan"), 1.0), "both finite; got nan and 1.0"),
        (lambda: HandOverValueReward(Slot(), None, 1.0, float("inf")), "both finite; got 1.0 and inf"),
        (lambda: ConstantBonus(2.0), r"\[0, 1\].*got 2.0"),
        (lambda: RewardMixture({"env": 0.0, "gail": 0.0}), "nothing to learn from"),
        (lambda: RewardMixture({"env": float("nan")}), "must be finite"),
        (
            lambda: RewardMixture({"env": "x"}),
            "reward.weights must have a number for each term, .* got {'env': 'x'}",
        ),
        (lambda: RewardMixture("env"), "reward.weights must have a number for each term, .* got 'env'"),  # pyright: ignore[reportArgumentType]
        (
            lambda: RewardMixture({"env": 1.0}, scales={"gail": 2.0}),
            "reward.scales has gail, which .* it has env",
        ),
        (
            lambda: weighted(RewardMixture({"env": 1.0}), {"own": GAILReward(Slot())}),
            "has no own; it has env",
        ),
        (
            lambda: weighted(RewardMixture({"env": 1.0, "calm": 2.0}), {"gail": None}),
            "has calm, and this recipe makes no such reward; it makes env, gail",
        ),
        (lambda: SkillChainReset(FixedStarts(), probability=1.5), r"\[0, 1\], got 1.5"),
    ],
)
def test_mistakes_are_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_terms_that_are_there_keep_their_weights_their_scales_and_the_scale_of_the_sum():
    """The last skill has no next one: its mixture has no tsr, and no scale of it."""
    mixture = RewardMixture({"env": 0.5, "gail": 0.25, "tsr": 100.0}, 0.1, scales={"gail": 2.0, "tsr": 0.5})
    last = {"reward_env": 0.05, "reward_gail": 0.05}
    for tsr, expected in ((TerminalStateReward(Slot()), last | {"reward_tsr": 5.0}), (None, last)):
        *terms, found = weighted(mixture, {"gail": GAILReward(Slot()), "tsr": tsr})
        assert found.effective_weights() == pytest.approx(expected) and len(terms) == len(expected) - 1


def test_torchrl_hands_on_which_simulations_take_a_step(make_env, policy):
    """A simulation that stands where it succeeded is paid nothing again, and does not count in the mean."""
    env = TransformedEnv(make_env(num_envs=2), TerminalStateReward(ConstantBonus(1.0)))
    start = env.reset()
    env.base_env.physics[:, 0] = 0.9
    first = env.step(policy(start))
    assert first["next", "reward_tsr"].flatten().tolist() == [1.0, 1.0]
    again = env.step(policy(env.step_mdp(first)).set("_step", torch.tensor([False, True])))
    assert again["next", "reward_tsr"].flatten().tolist() == [0.0, 1.0] and env.transform.successes == 3
