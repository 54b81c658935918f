"""What PPO does to a policy and its value network."""

import copy

import pytest
import torch
from small_skill import same, small_skill, state_of
from tensordict import TensorDict

from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import InvalidValueError
from tstar_rl.rollouts.collection import Collection, with_starts
from tstar_rl.transforms import RewardMixture
from tstar_rl.updates import PolicyUpdate, PPOSettings
from tstar_rl.updates.ppo import adapted_share, estimated_kl


def rollouts(make_env, skill: Skill, horizon: int = 16) -> Collection:
    return Collection(with_starts(make_env(num_envs=16, snapshots=False)), skill.policy, horizon)


def test_ppo_learns_to_move(make_env):
    skill = small_skill()
    collection = rollouts(make_env, skill)
    rates = {"learning_rate": 3e-3, "linear_decay": False, "entropy_coeff": 0.0}
    update = PolicyUpdate(
        skill.policy,
        skill.value,
        PPOSettings(minibatch=64, normalize_returns=True, **rates),
        skill.return_scale,
    )
    reward = RewardMixture({"env": 1.0}, reward_scale=1.0)
    obs = TensorDict({"observation": torch.zeros(1, 72)}, [1])
    before = float(skill.policy.get_dist(obs).mean[0, 0].detach())
    for _ in range(10):
        update(reward(collection.rollout()))
    assert float(skill.policy.get_dist(obs).mean[0, 0].detach()) > before + 0.2


@pytest.mark.parametrize("shape", [(256,), (2, 8, 16)])
def test_a_rollout_of_another_shape_is_refused(make_env, shape):
    """Time would be taken for simulations, and the values of others for those of the next states."""
    skill = small_skill()
    update = PolicyUpdate(skill.policy, skill.value, PPOSettings(), skill.return_scale)
    rollout = RewardMixture({"env": 1.0})(rollouts(make_env, skill).rollout())
    with pytest.raises(InvalidValueError, match=rf"\(simulations, steps\); got batch size \[{shape[0]}"):
        update(rollout.reshape(shape))


def test_critic_warmup_leaves_the_actor_alone(make_env):
    skill = small_skill()
    update = PolicyUpdate(skill.policy, skill.value, PPOSettings(critic_warmup=1), skill.return_scale)
    collection, reward = rollouts(make_env, skill), RewardMixture({"env": 1.0})
    policy, value = state_of(skill.policy), state_of(skill.value)
    log = update(reward(collection.rollout()))
    assert log["actor_steps"] == 0 and same(policy, state_of(skill.policy))
    assert not same(value, state_of(skill.value))
    assert update(reward(collection.rollout()))["actor_steps"] > 0
    assert not same(policy, state_of(skill.policy))


def test_kl_stop_holds_the_actor_and_not_the_critic(make_env):
    skill = small_skill()
    settings = PPOSettings(learning_rate=1e-2, kl_stop=1e-3, minibatch=64)
    update = PolicyUpdate(skill.policy, skill.value, settings, skill.return_scale)
    log = update(RewardMixture({"env": 1.0})(rollouts(make_env, skill).rollout()))
    assert log["kl"] > 1e-3
    assert log["actor_steps"] < log["critic_steps"] == 10 * 16 * 16 // 64


def test_the_actor_stays_held_for_the_rest_of_an_update(make_env, monkeypatch):
    """Also where a later minibatch has a small KL again."""
    kls = iter([0.0, 1.0, 0.0, 0.0])
    monkeypatch.setattr("tstar_rl.updates.ppo.estimated_kl", lambda *_: torch.tensor(next(kls)))
    skill = small_skill()
    settings = PPOSettings(kl_stop=0.1, minibatch=64, epochs=1)
    update = PolicyUpdate(skill.policy, skill.value, settings, skill.return_scale)
    log = update(RewardMixture({"env": 1.0})(rollouts(make_env, skill).rollout()))
    assert (log["actor_steps"], log["critic_steps"]) == (1, 4)


def test_an_update_is_made_of_nearly_equal_minibatches(make_env, monkeypatch):
    skill = small_skill()
    update = PolicyUpdate(skill.policy, skill.value, PPOSettings(minibatch=100, epochs=1), skill.return_scale)
    sizes, step = [], update._step
    monkeypatch.setattr(update, "_step", lambda batch, *rest: sizes.append(len(batch)) or step(batch, *rest))
    update(RewardMixture({"env": 1.0})(rollouts(make_env, skill).rollout()))
    assert sizes == [86, 85, 85]


@pytest.mark.parametrize(
    ("ratios", "expected"),
    [
        ([1.0, 1.0], 0.0),
        ([0.5, 2.0], 0.25),  # the mean of -ln r is 0
        ([0.5, 0.5], 0.193147),  # -.5 + ln 2
        ([2.0, 2.0], 0.306853),  # 1 - ln 2, where the mean of -ln r is negative
    ],
)
def test_the_kl_of_a_minibatch_by_hand(ratios, expected):
    r = torch.tensor(ratios)
    kl = estimated_kl(r.mean(), -r.log().mean())
    assert float(kl) == pytest.approx(expected, abs=1e-6) and kl >= 0


@pytest.mark.parametrize(("kl_stop", "moves"), [(0.2, False), (0.3, True)])
def test_the_actor_stops_at_the_kl_of_its_ratios(kl_stop, moves):
    """One action has become twice as likely and one half as likely: the KL is .25, and -ln r is 0 in the mean."""
    skill = small_skill()
    update = PolicyUpdate(
        skill.policy, skill.value, PPOSettings(kl_stop=kl_stop, minibatch=2), skill.return_scale
    )
    batch = TensorDict({"observation": torch.randn(2, 72), "action": torch.randn(2, 9)}, [2])
    now = skill.policy.get_dist(batch).log_prob(batch["action"]).detach()
    batch["action_log_prob"] = now - torch.tensor([0.5, 2.0]).log()
    batch["encoded"] = update.encoder.module(batch["observation"])
    batch["advantage"], batch["value_target"] = torch.tensor([[1.0], [-1.0]]), torch.zeros(2, 1)
    log = {"actor_steps": 0, "critic_steps": 0, "loss_policy": 0.0, "loss_critic": 0.0}
    assert update._step(batch, True, log) is moves and log["actor_steps"] == int(moves)
    assert float(log["kl"]) == pytest.approx(0.25, abs=1e-5)


@pytest.mark.parametrize(
    ("share", "kl", "expected"),
    [
        (0.9, 0.05, 0.6),  # above .04
        (0.6, 0.009, 0.9),  # below .01
        (0.6, 0.0, 0.9),
        (0.6, 0.02, 0.6),
        (0.9, 0.0, 1.0),  # never more than the rate itself
        (0.01, 1.0, 0.01),
    ],
)
def test_the_rates_share_follows_the_kl_by_hand(share, kl, expected):
    assert adapted_share(share, kl, target=0.02) == pytest.approx(expected)


def test_a_kl_target_makes_the_next_update_smaller_and_is_resumed(make_env):
    skill, reward = small_skill(), RewardMixture({"env": 1.0})
    settings = PPOSettings(learning_rate=1e-2, linear_decay=False, kl_target=1e-3, minibatch=64)
    update = PolicyUpdate(skill.policy, skill.value, settings, skill.return_scale)
    log = update(reward(rollouts(make_env, skill).rollout()))
    assert log["kl"] > 2e-3 and log["rate_share"] == pytest.approx(1 / 1.5)
    resumed = PolicyUpdate(skill.policy, skill.value, settings, skill.return_scale)
    resumed.load_state_dict(copy.deepcopy(update.state_dict()))
    for one in (update, resumed):
        one(reward(rollouts(make_env, skill).rollout()))
    # The second update has the share that the first ended with.
    rates = [one.actor_optimizer.param_groups[0]["lr"] for one in (update, resumed)]
    assert rates == pytest.approx([1e-2 / 1.5] * 2)


def test_an_update_goes_on_from_its_state(make_env):
    reward = RewardMixture({"env": 1.0})
    first = small_skill()
    collection = rollouts(make_env, first)
    batches = [reward(collection.rollout()).clone() for _ in range(2)]
    update = PolicyUpdate(first.policy, first.value, PPOSettings(minibatch=64), first.return_scale)
    update(batches[0])
    second = small_skill()
    resumed = PolicyUpdate(
        second.policy, second.value, PPOSettings(minibatch=64), second.return_scale, seed=9
    )
    second.load_network_state(first.network_state())
    resumed.load_state_dict(copy.deepcopy(update.state_dict()))
    assert update(batches[1]) == resumed(batches[1])
    assert same(state_of(first.policy), state_of(second.policy))


def test_the_critic_in_bfloat16_learns_and_the_actor_is_not_touched(make_env):
    rollout = RewardMixture({"env": 1.0})(rollouts(make_env, small_skill()).rollout())
    found = {}
    for coarse in (False, True):
        skill = small_skill()
        settings = PPOSettings(minibatch=64, epochs=1, critic_bfloat16=coarse)
        update = PolicyUpdate(skill.policy, skill.value, settings, skill.return_scale)
        encoded = update._with_advantage(rollout.clone())["encoded"]
        values = update.critic.module(encoded).detach()
        acts = update.loss.actor_network.get_dist(TensorDict({"encoded": encoded}, [len(encoded)]))
        assert torch.equal(acts.mean, skill.policy.get_dist(rollout.reshape(-1)).mean)
        log = update(rollout.clone())
        found[coarse] = values, log["loss_critic"], state_of(skill.value)
    assert found[True][0].dtype == torch.float32 and not torch.equal(found[True][0], found[False][0])
    torch.testing.assert_close(found[True][0], found[False][0], atol=0.05, rtol=0.05)
    assert found[True][1] == pytest.approx(found[False][1], rel=0.05)
    assert not same(found[True][2], found[False][2])


def test_rates_fall_to_nothing_with_progress_and_the_actors_rises_before(make_env):
    """Two minibatches an update; of the actor's first four steps each has a quarter more of the rate."""
    skill = small_skill()
    settings = PPOSettings(
        learning_rate=4e-3,
        critic_learning_rate=2e-3,
        minibatch=128,
        epochs=1,
        rate_warmup=4,
        kl_stop=float("inf"),
    )
    update = PolicyUpdate(skill.policy, skill.value, settings, skill.return_scale)
    collection, reward, rates = rollouts(make_env, skill), RewardMixture({"env": 1.0}), []
    for progress in (0.0, 0.5, 1.0):
        update(reward(collection.rollout()), progress)
        optimizers = (update.actor_optimizer, update.critic_optimizer)
        rates.append([optimizer.param_groups[0]["lr"] for optimizer in optimizers])
    torch.testing.assert_close(torch.tensor(rates), torch.tensor([[2e-3, 2e-3], [2e-3, 1e-3], [0.0, 0.0]]))


@pytest.mark.parametrize(("clip", "moves"), [(0.2, False), (0.6, True)])
def test_a_ratio_beyond_the_clip_moves_the_actor_no_further(clip, moves):
    """A good action is half as likely again as it was, a bad one less likely by as much."""
    skill = small_skill()
    settings = PPOSettings(clip_epsilon=clip, entropy_coeff=0.0, minibatch=2)
    update = PolicyUpdate(skill.policy, skill.value, settings, skill.return_scale)
    batch = TensorDict({"observation": torch.randn(2, 72), "action": torch.randn(2, 9)}, [2])
    now = skill.policy.get_dist(batch).log_prob(batch["action"]).detach()
    batch["action_log_prob"] = now - torch.tensor([1.5, 1 / 1.5]).log()
    batch["encoded"] = update.encoder.module(batch["observation"])
    batch["advantage"], batch["value_target"] = torch.tensor([[1.0], [-1.0]]), torch.zeros(2, 1)
    before = state_of(skill.policy)
    update._step(batch, True, {"actor_steps": 0, "critic_steps": 0, "loss_policy": 0.0, "loss_critic": 0.0})
    assert same(before, state_of(skill.policy)) is not moves
