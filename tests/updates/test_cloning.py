"""Behaviour cloning."""

import pytest
import torch
from small_skill import small_skill
from torch.optim.optimizer import register_optimizer_step_pre_hook

from tstar_rl.checks import DivergedError
from tstar_rl.models.networks import split_policy
from tstar_rl.updates import (
    BehaviourCloningSettings,
    behaviour_cloning,
)


def test_cloning_reproduces_a_linear_expert():
    skill = small_skill()
    obs = torch.randn(512, 72, generator=torch.Generator().manual_seed(0))
    actions = (0.3 * obs[:, :9]).clamp(-0.8, 0.8)
    settings = BehaviourCloningSettings(epochs=40, minibatch=64, learning_rate=3e-3, cosine_decay=True)
    log = behaviour_cloning(skill.policy, obs, actions, settings)
    assert log["bc_loss"] < 0.1 * float(actions.square().mean())


@pytest.mark.parametrize(
    ("cosine_decay", "shares"),
    [(False, [1.0, 1.0, 1.0, 1.0]), (True, [1.0, 0.853553, 0.5, 0.146447])],  # (1 + cos(pi e / 4)) / 2
)
def test_the_rate_of_each_epoch(cosine_decay, shares):
    rates = []
    hook = register_optimizer_step_pre_hook(lambda adam, *rest: rates.append(adam.param_groups[0]["lr"]))
    settings = BehaviourCloningSettings(epochs=4, minibatch=64, learning_rate=3e-3, cosine_decay=cosine_decay)
    try:
        behaviour_cloning(small_skill().policy, torch.randn(64, 72), torch.zeros(64, 9), settings)
    finally:
        hook.remove()
    assert rates == pytest.approx([3e-3 * share for share in shares], rel=1e-4)


def test_the_minibatches_of_an_epoch_are_nearly_equal():
    """Of 65 rows 33 and 32, not 64 and one that would get a whole step."""
    policy, sizes = small_skill().policy, []
    _, body = split_policy(policy)
    body.module.register_forward_hook(lambda module, inputs, output: sizes.append(len(inputs[0])))
    settings = BehaviourCloningSettings(epochs=1, minibatch=64)
    behaviour_cloning(policy, torch.randn(65, 72), torch.zeros(65, 9), settings)
    assert sizes == [33, 32]


def test_each_observation_has_its_action():
    skill = small_skill()
    observations = torch.zeros(4, 72)
    for number in (3, 5):
        with pytest.raises(ValueError, match=f"got 4 observations and {number} actions"):
            behaviour_cloning(skill.policy, observations, torch.zeros(number, 9), BehaviourCloningSettings())
    for wrong in (
        torch.zeros(64, 1),
        torch.zeros(64),
        torch.zeros(64, 3, 3),
    ):  # torch would broadcast the first
        with pytest.raises(ValueError, match=r"actions must be \(n, 9\), as the policy's are; got \(64"):
            behaviour_cloning(skill.policy, torch.zeros(64, 72), wrong, BehaviourCloningSettings())


def test_a_loss_that_is_no_number_ends_it():
    actions = torch.zeros(64, 9).index_fill(0, torch.tensor(3), torch.nan)
    with pytest.raises(
        DivergedError, match="has diverged: bc_loss is nan after 1 epochs of behaviour cloning"
    ):
        behaviour_cloning(
            small_skill().policy, torch.randn(64, 72), actions, BehaviourCloningSettings(epochs=1)
        )
