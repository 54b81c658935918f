"""Behaviour cloning."""

import torch
from small_skill import small_skill

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
