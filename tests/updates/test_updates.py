"""What updates do to networks."""

import copy
import math

import pytest
import torch
from tensordict import TensorDict
from torchrl.objectives.value import GAE

from tstar_rl.chaining.skill import NetworkSettings, Skill
from tstar_rl.models.blocks import in_blocks
from tstar_rl.models.networks import make_discriminator
from tstar_rl.models.return_scale import ReturnScale
from tstar_rl.rollouts.collection import Collection, with_starts
from tstar_rl.transforms import RewardMixture
from tstar_rl.updates import (
    BehaviourCloningSettings,
    DiscriminatorSettings,
    DiscriminatorUpdate,
    PolicyUpdate,
    PPOSettings,
    behaviour_cloning,
)

SMALL = NetworkSettings(hidden=(32, 32), std="fixed", action_std=0.3, hand_std=0.3)


def small_skill() -> Skill:
    torch.manual_seed(0)
    return Skill("point", 0, SMALL)


def rollouts(make_env, skill: Skill, horizon: int = 16) -> Collection:
    return Collection(with_starts(make_env(num_envs=16, snapshots=False)), skill.policy, horizon)


def state_of(module: torch.nn.Module) -> dict[str, torch.Tensor]:
    return {key: value.clone() for key, value in module.state_dict().items()}


def same(a: dict[str, torch.Tensor], b: dict[str, torch.Tensor]) -> bool:
    return all(torch.equal(a[key], b[key]) for key in a)


def test_return_scale_by_hand():
    scale = ReturnScale()
    reward = torch.tensor([[[1.0], [2.0], [4.0]]])
    done = torch.tensor([[[False], [True], [False]]])
    scaled, carried = scale(reward, done, torch.zeros(1, 1), 0.5)
    # Returns 1, 2.5 and, after the end, 4: mean 2.5, variance (1.5^2 + 0 + 1.5^2) / 3 = 1.5.
    assert float(scale.var) == pytest.approx(1.5)
    torch.testing.assert_close(scaled, reward / 1.5**0.5)
    assert float(carried) == 4.0


def test_return_scale_in_parts_is_that_of_the_whole():
    torch.manual_seed(0)
    reward, done = torch.randn(3, 8, 1), torch.rand(3, 8, 1) < 0.2
    whole, parts = ReturnScale(), ReturnScale()
    whole(reward, done, torch.zeros(3, 1), 0.9)
    _, carried = parts(reward[:, :5], done[:, :5], torch.zeros(3, 1), 0.9)
    parts(reward[:, 5:], done[:, 5:], carried, 0.9)
    torch.testing.assert_close(whole.var, parts.var)


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


def test_cloning_reproduces_a_linear_expert():
    skill = small_skill()
    obs = torch.randn(512, 72, generator=torch.Generator().manual_seed(0))
    actions = (0.3 * obs[:, :9]).clamp(-0.8, 0.8)
    settings = BehaviourCloningSettings(epochs=40, minibatch=64, learning_rate=3e-3, cosine_decay=True)
    log = behaviour_cloning(skill.policy, obs, actions, settings)
    assert log["bc_loss"] < 0.1 * float(actions.square().mean())


def test_a_discriminator_learns_to_tell_apart():
    torch.manual_seed(0)
    network = make_discriminator(72, hidden=(32,))
    settings = DiscriminatorSettings(learning_rate=1e-2, gradient_penalty=0.0)
    update = DiscriminatorUpdate("d_omega", network, {"initiation": 1.0, "termination": 0.0}, settings)
    high, low = torch.randn(200, 72) + 1, torch.randn(200, 72) - 1
    log = update(termination=low, initiation=high)  # by name: their order does not matter
    assert float(network(high).detach().mean()) > float(network(low).detach().mean()) + 0.5
    assert log["d_omega_initiation_score"] > log["d_omega_termination_score"]
    with pytest.raises(
        TypeError, match="d_omega takes observations of initiation, termination; got expert, agent"
    ):
        update(expert=high, agent=low)


def two_sides(one: float, other: float) -> list[dict[str, torch.Tensor]]:
    """Initiation and termination sets at two seams, apart along one number each."""
    sides = []
    for slot, sign in ((0, one), (1, other)):
        states = torch.randn(200, 72, generator=torch.Generator().manual_seed(slot))
        initiation, termination = states.clone(), states.clone()
        initiation[:, slot] += sign
        termination[:, slot] -= sign
        sides.append({"initiation": initiation, "termination": termination})
    return sides


def test_a_discriminator_of_two_sides_tells_apart_at_both():
    labels = {"initiation": 1.0, "termination": 0.0}
    settings = DiscriminatorSettings(learning_rate=1e-2, gradient_penalty=0.0, steps=200)

    def gaps(sides: list[dict[str, torch.Tensor]], used: slice) -> list[float]:
        torch.manual_seed(0)
        network = make_discriminator(72, hidden=(32,))
        DiscriminatorUpdate("d", network, labels, settings).on_sides(sides[used])
        said = [{kind: network(rows).detach().mean() for kind, rows in side.items()} for side in sides]
        return [float(each["initiation"] - each["termination"]) for each in said]

    sides = two_sides(1.5, -1.5)
    assert min(gaps(sides, slice(0, 2))) > 0.4
    first = gaps(sides, slice(0, 1))
    assert first[0] > 0.4 > abs(first[1])  # what T-STAR's has: one side


def test_one_side_of_weight_one_is_the_plain_update_and_an_empty_side_is_none():
    labels, side = {"initiation": 1.0, "termination": 0.0}, two_sides(1.0, 1.0)[0]
    found = []
    for number in range(3):
        torch.manual_seed(0)
        network = make_discriminator(72, hidden=(8,))
        update = DiscriminatorUpdate("d", network, labels, DiscriminatorSettings(steps=5))
        empty = {"initiation": torch.zeros(0, 1), "termination": side["termination"]}
        log = update(**side) if number == 0 else update.on_sides([side, empty][:number], weight=1.0)
        found.append((log, state_of(network)))
        assert update.on_sides([empty]) == {}
    assert found[0][0] == found[1][0] == found[2][0]
    assert same(found[0][1], found[1][1]) and same(found[0][1], found[2][1])
    with pytest.raises(TypeError, match="the update of d takes observations of initiation, termination; got"):
        update.on_sides([{"expert": side["initiation"]}])


@pytest.mark.parametrize("steps", [1, 5])
def test_an_update_takes_the_steps_and_the_minibatch_that_are_asked_for(steps, monkeypatch):
    torch.manual_seed(0)
    settings = DiscriminatorSettings(steps=steps, minibatch=7)
    update = DiscriminatorUpdate(
        "f_phi", make_discriminator(72, hidden=(8,)), {"expert": 1.0, "agent": -1.0}, settings
    )
    sizes, draw = [], update._draw
    monkeypatch.setattr(update, "_draw", lambda rows: sizes.append(len(draw(rows))) or draw(rows))
    update(expert=torch.randn(20, 72), agent=torch.randn(30, 72))
    assert sizes == [7] * 2 * steps
    taken = [state["step"] for state in update.optimizer.state.values()]
    assert taken and all(int(step) == steps for step in taken)


def test_an_empty_set_is_no_update():
    network = make_discriminator(72)
    before = state_of(network)
    update = DiscriminatorUpdate("f_phi", network, {"expert": 1.0, "agent": -1.0}, DiscriminatorSettings())
    assert update(expert=torch.zeros(0, 72), agent=torch.zeros(3, 72)) == {}
    assert same(before, state_of(network))


def test_values_of_next_states_are_looked_at_once_and_right():
    """As TorchRL's GAE on both states of every step, where episodes end and are truncated in the middle."""
    torch.manual_seed(0)
    skill = small_skill()
    sequence, done = torch.randn(5, 8, 72), torch.rand(5, 7, 1) < 0.3
    following = sequence[:, 1:].clone()
    following[done.squeeze(-1)] = torch.randn(int(done.sum()), 72)
    step = {"observation": following, "reward": torch.randn(5, 7, 1), "done": done}
    step["terminated"] = done & (torch.rand(5, 7, 1) < 0.5)
    rollout = TensorDict({"observation": sequence[:, :-1], "next": step}, [5, 7])
    update = PolicyUpdate(skill.policy, skill.value, PPOSettings(), ReturnScale())
    expected = GAE(gamma=0.99, lmbda=0.95, value_network=skill.value, deactivate_vmap=True)(rollout.clone())
    found = update.gae(update._with_values(rollout.clone()))
    assert (done & ~step["terminated"]).any()
    torch.testing.assert_close(found["advantage"], expected["advantage"])
    torch.testing.assert_close(found["value_target"], expected["value_target"])


@pytest.mark.parametrize("shape", [(0,), (5,), (3, 700), (2, 2, 600)])
def test_a_network_in_blocks_gives_what_it_gives_at_once(shape):
    network, rows = make_discriminator(72), torch.randn(*shape, 72)
    with torch.no_grad():
        torch.testing.assert_close(in_blocks(network, rows), network(rows))


def test_bfloat16_is_coarser_and_keeps_parameters_in_float32():
    torch.manual_seed(0)
    network, rows = make_discriminator(72), torch.randn(300, 72)
    exact = network(rows).detach()
    settings = DiscriminatorSettings(bfloat16=True, steps=3)
    update = DiscriminatorUpdate("f_phi", network, {"expert": 1.0, "agent": -1.0}, settings)
    coarse = network(rows).detach()
    assert coarse.dtype == torch.float32 and not torch.equal(coarse, exact)
    torch.testing.assert_close(coarse, exact, atol=0.03, rtol=0.03)
    log = update(expert=rows, agent=rows + 1)
    assert all(math.isfinite(value) for value in log.values())
    assert {value.dtype for value in network.parameters()} == {torch.float32}
    assert not torch.equal(network(rows), coarse)


def test_the_critic_in_bfloat16_learns_and_the_actor_is_not_touched(make_env):
    rollout = RewardMixture({"env": 1.0})(rollouts(make_env, small_skill()).rollout())
    found = {}
    for coarse in (False, True):
        skill = small_skill()
        settings = PPOSettings(minibatch=64, epochs=1, critic_bfloat16=coarse)
        update = PolicyUpdate(skill.policy, skill.value, settings, skill.return_scale)
        encoded = update._with_advantage(rollout.clone())["encoded"]
        values = update.critic.module(encoded).detach()
        log = update(rollout.clone())
        found[coarse] = values, log["loss_critic"], state_of(skill.value)
    assert found[True][0].dtype == torch.float32 and not torch.equal(found[True][0], found[False][0])
    torch.testing.assert_close(found[True][0], found[False][0], atol=0.05, rtol=0.05)
    assert found[True][1] == pytest.approx(found[False][1], rel=0.05)
    assert not same(found[True][2], found[False][2])
