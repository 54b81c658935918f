"""What settings of updates are refused, and that every config's are not."""

import math

import pytest
import torch
from hydra import compose, initialize_config_dir
from small_skill import same, small_skill, state_of

from tstar_rl.config.values import CONFIGS, settings
from tstar_rl.models.networks import make_discriminator
from tstar_rl.rollouts.collection import Collection, with_starts
from tstar_rl.signal_equations import outcome_loss
from tstar_rl.spirl import LatentPolicySettings, ModelTrainingSettings
from tstar_rl.transforms import RewardMixture
from tstar_rl.updates import (
    BehaviourCloningSettings,
    DiscriminatorSettings,
    DiscriminatorUpdate,
    LabelledSettings,
    LabelledUpdate,
    PolicyUpdate,
    PPOSettings,
)


@pytest.mark.parametrize(
    ("kind", "values", "message"),
    [
        (DiscriminatorSettings, {"steps": 0}, "DiscriminatorSettings.steps must be at least 1, got 0"),
        (
            DiscriminatorSettings,
            {"minibatch": 0},
            "DiscriminatorSettings.minibatch must be at least 1, got 0",
        ),
        (DiscriminatorSettings, {"learning_rate": 0.0}, "learning_rate must be positive, got 0.0"),
        (
            DiscriminatorSettings,
            {"gradient_penalty": -1.0},
            "gradient_penalty must be not negative, got -1.0",
        ),
        (
            DiscriminatorSettings,
            {"penalty": "one"},
            "DiscriminatorSettings.penalty must be one of zero_at_first, one_between; got 'one'",
        ),
        (
            DiscriminatorSettings,
            {"penalty": "one_between", "gradient_penalty": 0.0},
            r"DiscriminatorSettings.penalty must be zero_at_first where gradient_penalty is 0 .*, got one_between",
        ),
        (PPOSettings, {"epochs": 0}, "PPOSettings.epochs must be at least 1, got 0"),
        (PPOSettings, {"epochs": 2.5}, "PPOSettings.epochs must be a whole number, got 2.5"),
        (PPOSettings, {"epochs": True}, "PPOSettings.epochs must be a whole number, got True"),
        (PPOSettings, {"learning_rate": "3e-4"}, "PPOSettings.learning_rate must be a number, got '3e-4'"),
        (PPOSettings, {"learning_rate": math.nan}, "PPOSettings.learning_rate must be positive, got nan"),
        (PPOSettings, {"critic_learning_rate": -1e-3}, "critic_learning_rate must be positive, got -0.001"),
        (PPOSettings, {"max_grad_norm": math.inf}, "max_grad_norm must be positive, got inf"),
        (PPOSettings, {"critic_coeff": 0.0}, "PPOSettings.critic_coeff must be positive, got 0.0"),
        (PPOSettings, {"critic_warmup": -1}, "critic_warmup must be not negative, got -1"),
        (PPOSettings, {"gamma": 1.01}, r"gamma must be in \[0, 1\], got 1.01"),
        (PPOSettings, {"clip_epsilon": 1.5}, r"clip_epsilon must be in \(0, 1\], got 1.5"),
        (PPOSettings, {"kl_stop": 0.0}, r"kl_stop must be positive \(.inf: no limit\), got 0.0"),
        (
            BehaviourCloningSettings,
            {"epochs": 0},
            "BehaviourCloningSettings.epochs must be at least 1, got 0",
        ),
        (LatentPolicySettings, {"tau": 0.0}, r"LatentPolicySettings.tau must be in \(0, 1\], got 0.0"),
        (LatentPolicySettings, {"updates": 0.0}, "LatentPolicySettings.updates must be positive, got 0.0"),
        (LatentPolicySettings, {"critic_loss": "l1"}, "critic_loss must be one of smooth_l1, l2; got 'l1'"),
        (LatentPolicySettings, {"first": 0}, "LatentPolicySettings.first must be at least 1, got 0"),
        (ModelTrainingSettings, {"held_out": 1.5}, r"held_out must be in \[0, 1\], got 1.5"),
        (ModelTrainingSettings, {"beta": -0.1}, "ModelTrainingSettings.beta must be not negative, got -0.1"),
    ],
)
def test_a_number_out_of_range_is_named(kind, values, message):
    with pytest.raises(ValueError, match=message):
        kind(**values)


@pytest.mark.parametrize("name", ["entropy_coeff", "critic_warmup", "rate_warmup", "gae_lambda", "gamma"])
def test_a_zero_that_means_none_is_one_update_of_the_policy(name, make_env):
    skill = small_skill()
    env = with_starts(make_env(num_envs=16, snapshots=False))
    rollout = RewardMixture({"env": 1.0})(Collection(env, skill.policy, 8).rollout())
    before = state_of(skill.policy), state_of(skill.value)
    settings = PPOSettings(**{name: 0}, epochs=1, minibatch=64)
    log = PolicyUpdate(skill.policy, skill.value, settings, skill.return_scale)(rollout)
    assert all(math.isfinite(value) for value in log.values()) and log["actor_steps"] == 2
    for states, module in zip(before, (skill.policy, skill.value), strict=True):
        assert not same(states, state_of(module))


def test_zeros_that_mean_none_in_the_updates_of_other_networks():
    torch.manual_seed(0)
    network, rows = make_discriminator(72, hidden=(8,)), torch.randn(20, 72)
    settings, labels = DiscriminatorSettings(gradient_penalty=0.0, steps=1), {"expert": 1.0, "agent": -1.0}
    log = DiscriminatorUpdate("f_phi", network, labels, settings)(expert=rows, agent=rows + 1)
    assert log["f_phi_loss_gradient_penalty"] == 0
    learning = LabelledSettings(weight_decay=0.0, noise=0.0, steps=1)
    log |= LabelledUpdate("f", network, outcome_loss, learning)(rows, torch.ones(20))
    assert len(log) > 4 and all(math.isfinite(value) for value in log.values())
    LatentPolicySettings(critic_warmup=0)  # its default, with which tests/spirl updates


@pytest.mark.parametrize("scale", [path.stem for path in (CONFIGS / "scale").glob("*.yaml")])
def test_those_of_every_scale_pass(scale):
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/tstar", [f"scale={scale}"])
    for section in (config.ppo, {**config.ppo, **config.chain.ppo}):
        settings(PPOSettings, section)
    for section in (config.f_phi, config.d_omega):
        settings(DiscriminatorSettings, section)
    settings(BehaviourCloningSettings, config.bc)


@pytest.mark.parametrize("scale", [path.stem for path in (CONFIGS / "spirl").glob("*.yaml")])
def test_those_of_every_scale_of_spirl_pass(scale):
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/spirl", [f"scale={scale}"])
    settings(LatentPolicySettings, config.spirl.policy)
    settings(ModelTrainingSettings, config.spirl.model_training)
