"""Networks and what their inputs pass through: shapes, exploration, normalisation."""

import pytest
import torch
from tensordict import TensorDict
from test_features import description
from torch.testing import assert_close
from torchrl.envs.utils import ExplorationType, set_exploration_type
from torchrl.objectives import ClipPPOLoss

from tstar_rl.models import networks
from tstar_rl.models.blocks import in_blocks
from tstar_rl.models.normalizer import Normalizer
from tstar_rl.models.relative_features import RelativeFeatures


def test_normalizer_fits_floors_and_clips():
    normalizer = Normalizer(2)
    normalizer.fit(torch.tensor([[0.0, 5.0], [4.0, 5.0]]))  # deviations 2 and 0, the latter floored at 0.02
    out = normalizer(torch.tensor([[4.0, 5.01], [2.0, 6.0]]))
    assert_close(out, torch.tensor([[1.0, 0.5], [0.0, 10.0]]), atol=1e-4, rtol=0)


def test_a_floor_can_be_raised_after_the_fact():
    normalizer = Normalizer(2)
    normalizer.fit(torch.tensor([[0.0, -1.0], [0.002, 1.0]]), floor=0.005)  # deviations .001 and 1
    torch.testing.assert_close(normalizer.scale, torch.tensor([0.005, 1.0]))
    assert normalizer.raise_to(0.02) == 1
    torch.testing.assert_close(normalizer.scale, torch.tensor([0.02, 1.0]))
    assert normalizer.raise_to(0.01) == 0 and float(normalizer.scale[0]) == pytest.approx(0.02)
    with pytest.raises(ValueError, match="a floor must be positive, got 0"):
        normalizer.raise_to(0.0)
    with pytest.raises(ValueError, match="a floor must be positive, got 0"):
        normalizer.fit(torch.zeros(3, 2), floor=0.0)


def test_deviations_are_widened_to_those_of_other_states():
    normalizer = Normalizer(2)
    normalizer.fit(
        torch.tensor([[0.0, -1.0], [0.002, 1.0]]), floor=0.005
    )  # means .001 and 0, deviations .005 and 1
    # Around those means the new states have deviations of 0.3 (-.3 and .3) and .5.
    assert normalizer.widen(torch.tensor([[-0.299, 0.5], [0.301, -0.5]])) == 1
    torch.testing.assert_close(normalizer.scale, torch.tensor([0.3, 1.0]))
    torch.testing.assert_close(normalizer.loc, torch.tensor([0.001, 0.0]))
    assert normalizer.widen(torch.zeros(0, 2)) == 0
    assert normalizer.widen(torch.zeros(0, 0)) == 0  # the path of a skill that nothing came to


def test_running_statistics_equal_those_of_all_rows():
    rows = torch.randn(60, 3, generator=torch.Generator().manual_seed(1)) * 3 + 1
    running, whole = Normalizer(3), Normalizer(3)
    for part in rows.split([10, 1, 49]):
        running.update(part)
    whole.fit(rows)
    for name in ("loc", "scale", "var", "count"):
        assert_close(getattr(running, name), getattr(whole, name))


@pytest.mark.parametrize("std", ["state", "fixed"])
def test_policy_samples_and_is_deterministic_when_asked(std):
    features = RelativeFeatures(description())
    policy = networks.make_policy(72, std=std, action_std=0.2, normalizer=Normalizer(72), features=features)
    batch = TensorDict({"observation": torch.randn(500, 72)}, [500])
    out = policy(batch.clone())
    assert_close((out["action"] - out["loc"]).std(), torch.tensor(0.2), atol=0.03, rtol=0)
    assert_close(out["action_log_prob"], policy.get_dist(out).log_prob(out["action"]))
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        out = policy(batch.clone())
    assert_close(out["action"], out["loc"])
    assert out["loc"].abs().max() <= 1


def test_action_std_is_set_in_place_where_a_loss_sees_it():
    policy = networks.make_policy(72, std="fixed", action_std=[0.1] * 9)
    loss = ClipPPOLoss(policy, networks.make_value(72))
    batch = policy(TensorDict({"observation": torch.randn(16, 72)}, [16])).detach()
    batch.update({"advantage": torch.ones(16, 1), "value_target": torch.zeros(16, 1)})
    kept = batch["scale"].clone()
    assert_close(loss(batch)["kl_approx"], torch.tensor(0.0), atol=1e-5, rtol=0)
    networks.set_action_std(policy, 0.3)
    assert loss(batch)["kl_approx"].abs() > 0.5
    assert_close(policy(TensorDict(observation=torch.zeros(72)))["scale"], torch.full((9,), 0.3))
    assert_close(batch["scale"], kept)
    with pytest.raises(ValueError, match="one positive number or 9"):
        networks.set_action_std(policy, [0.1, 0.2])
    with pytest.raises(ValueError, match="std='state'"):
        networks.set_action_std(networks.make_policy(72), 0.1)


def test_value_and_discriminator_shapes():
    batch = TensorDict({"observation": torch.randn(4, 5, 72)}, [4, 5])
    assert networks.make_value(72)(batch)["state_value"].shape == (4, 5, 1)
    assert networks.make_discriminator(72, normalizer=Normalizer(72))(batch["observation"]).shape == (4, 5, 1)


def test_the_encoder_of_policy_and_value_can_be_computed_once():
    shared = {"normalizer": Normalizer(72), "features": RelativeFeatures(description())}
    policy, value = networks.make_policy(72, **shared), networks.make_value(72, **shared)
    shared["normalizer"].fit(torch.randn(50, 72))
    encoder, actor, critic = networks.split_encoder(policy, value)
    batch = TensorDict({"observation": torch.randn(6, 72)}, [6])
    whole = value(policy(batch.clone()))
    assert "encoded" not in whole
    parts = critic(actor(encoder(batch)))
    for name in ("loc", "scale", "state_value"):
        assert torch.equal(parts[name], whole[name])
    assert {id(p) for p in actor.parameters()} == {id(p) for p in policy.parameters()}
    assert not list(encoder.parameters())


@pytest.mark.parametrize("what", ["normalizer", "features"])
def test_a_value_network_that_sees_something_else_than_the_policy_is_refused(what):
    for other in ({}, {what: Normalizer(72) if what == "normalizer" else RelativeFeatures(description())}):
        one = {what: Normalizer(72) if what == "normalizer" else RelativeFeatures(description())}
        with pytest.raises(ValueError, match="policy and value must be made with one normaliser and one"):
            networks.split_encoder(networks.make_policy(72, **one), networks.make_value(72, **other))
    networks.split_encoder(networks.make_policy(72), networks.make_value(72))


@pytest.mark.parametrize("shape", [(0,), (5,), (3, 700), (2, 2, 600)])
def test_a_network_in_blocks_gives_what_it_gives_at_once(shape):
    network, rows = networks.make_discriminator(72), torch.randn(*shape, 72)
    with torch.no_grad():
        assert_close(in_blocks(network, rows), network(rows))
