"""What one step of PPO's optimisers descends, and how far."""

import pytest
import torch
from tensordict import TensorDict

from tstar_rl.chaining.skill import Skill
from tstar_rl.models.network_settings import NetworkSettings
from tstar_rl.updates import PolicyUpdate, PPOSettings


def one_step(settings: PPOSettings, advantage: float) -> tuple[PolicyUpdate, TensorDict, dict[str, float]]:
    """An update that has made one step, its actor's deviation learned, on a batch with advantages + and - that.

    Also the batch and what was logged.
    """
    torch.manual_seed(0)
    skill = Skill("point", 0, NetworkSettings(hidden=(32, 32), std="state"), obs_dim=72)
    update = PolicyUpdate(skill.policy, skill.value, settings, skill.return_scale)
    batch = TensorDict({"observation": torch.randn(2, 72), "action": torch.randn(2, 9)}, [2])
    batch["action_log_prob"] = skill.policy.get_dist(batch).log_prob(batch["action"]).detach()
    batch["encoded"] = update.encoder.module(batch["observation"])
    batch["advantage"] = torch.tensor([[advantage], [-advantage]])
    batch["value_target"] = torch.full((2, 1), 100.0)
    batch["before"] = skill.policy.get_dist(batch).stddev.detach()
    log = {"actor_steps": 0, "critic_steps": 0, "loss_policy": 0.0, "loss_critic": 0.0}
    batch["value"] = skill.value(TensorDict({"observation": batch["observation"]}, [2]))[
        "state_value"
    ].detach()
    update._step(batch, True, log)
    batch["after"] = skill.policy.get_dist(batch).stddev.detach()
    return update, batch, log


def test_the_bonus_for_entropy_makes_the_deviation_grow():
    """Without advantages nothing else moves the actor."""
    _, batch, _ = one_step(PPOSettings(entropy_coeff=0.1), 0.0)
    assert (batch["after"] > batch["before"]).all()
    _, batch, _ = one_step(PPOSettings(entropy_coeff=0.0), 0.0)
    assert torch.equal(batch["after"], batch["before"])


def test_the_gradients_of_actor_and_critic_are_each_clipped_to_the_norm():
    for limit in (1e-3, 2e-3):
        update, *_ = one_step(PPOSettings(max_grad_norm=limit), 1.0)
        for parameters in (update.actor_parameters, update.critic_parameters):
            norm = torch.nn.utils.get_total_norm([each.grad for each in parameters if each.grad is not None])
            assert float(norm) == pytest.approx(limit, rel=1e-3)


def gradients(parameters) -> torch.Tensor:
    return torch.cat([each.grad.flatten() for each in parameters if each.grad is not None])


def test_the_critics_loss_is_the_squared_error():
    """Of targets of 100 a smooth loss would be a hundredth of it."""
    _, batch, log = one_step(PPOSettings(critic_coeff=0.5), 1.0)
    error = (batch["value"] - batch["value_target"]).square().mean()
    assert log["loss_critic"] == pytest.approx(0.5 * float(error), rel=1e-4)


def test_advantages_are_divided_by_their_deviation_in_a_minibatch():
    moved = [one_step(PPOSettings(max_grad_norm=1e9), size)[0] for size in (1.0, 10.0)]
    first, second = (gradients(update.actor_parameters) for update in moved)
    assert first.abs().max() > 0
    torch.testing.assert_close(first, second)


def test_the_critics_loss_has_its_coefficient():
    settings = [PPOSettings(max_grad_norm=1e9, critic_coeff=share) for share in (0.5, 1.0)]
    half, whole = (gradients(one_step(each, 1.0)[0].critic_parameters) for each in settings)
    assert half.abs().max() > 0
    torch.testing.assert_close(2 * half, whole)
