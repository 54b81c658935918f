"""The discriminators' losses on numbers worked by hand, and that training with them separates."""

import pytest
import torch
from tensordict import TensorDict
from torch import nn
from torch.testing import assert_close

from tstar_rl.models.networks import Discriminator, make_discriminator
from tstar_rl.models.normalizer import Normalizer
from tstar_rl.objectives import GAILDiscriminatorLoss, InitiationSetLoss


def linear(weights: list[float], normalizer=None) -> Discriminator:
    network = nn.Linear(len(weights), 1, bias=False)
    network.weight.data = torch.tensor([weights])
    return Discriminator(network, normalizer)


def test_gail_loss_on_a_linear_discriminator():
    # f(x) = 3 x0 + 4 x1. Experts: f = 3 and 1, agents: f = 0 and -4. Loss: (4 + 0) / 2 + (1 + 9) / 2 = 7.
    # The gradient is (3, 4) everywhere: penalty 10 * 0.5 * 25 = 125.
    batch = TensorDict(
        {
            "expert_observation": torch.tensor([[1.0, 0.0], [-1.0, 1.0]]),
            "observation": torch.tensor([[0.0, 0.0], [0.0, -1.0]]),
        },
        [2],
    )
    out = GAILDiscriminatorLoss(linear([3.0, 4.0]))(batch)
    assert_close(out["loss_discriminator"], torch.tensor(7.0))
    assert_close(out["loss_gradient_penalty"], torch.tensor(125.0))
    assert_close(out["expert_score"], torch.tensor(2.0))
    assert_close(out["agent_score"], torch.tensor(-2.0))


def test_the_penalty_is_on_the_normalised_observation():
    normalizer = Normalizer(2)
    normalizer.fit(torch.tensor([[-0.1, -5.0], [0.1, 5.0]]))  # deviations 0.1 and 5
    batch = TensorDict({"expert_observation": torch.zeros(1, 2), "observation": torch.zeros(1, 2)}, [1])
    out = GAILDiscriminatorLoss(linear([3.0, 4.0], normalizer))(batch)
    assert_close(out["loss_gradient_penalty"], torch.tensor(125.0))


def test_initiation_set_loss_on_a_linear_discriminator():
    # d(x) = 0.5 x. Initiation: d = 1 and 0.5, termination: d = 0.5 and -1. Loss: 0.25 / 2 + 1.25 / 2 = 0.75.
    batch = TensorDict(
        {
            "initiation_observation": torch.tensor([[2.0], [1.0]]),
            "termination_observation": torch.tensor([[1.0], [-2.0]]),
        },
        [2],
    )
    out = InitiationSetLoss(linear([0.5]))(batch)
    assert_close(out["loss_initiation_set"], torch.tensor(0.75))
    assert out["loss_gradient_penalty"] == 0
    penalised = InitiationSetLoss(linear([0.5]), gradient_penalty_weight=10.0)(batch)
    assert_close(penalised["loss_gradient_penalty"], torch.tensor(1.25))  # 10 * 0.5 * 0.25


@pytest.mark.parametrize(
    ("loss_class", "high", "low", "labels"),
    [
        (GAILDiscriminatorLoss, "expert_observation", "observation", (1.0, -1.0)),
        (InitiationSetLoss, "initiation_observation", "termination_observation", (1.0, 0.0)),
    ],
)
def test_training_approaches_the_labels(loss_class, high, low, labels):
    torch.manual_seed(0)
    network = make_discriminator(4, hidden=(32, 32))
    loss = loss_class(network, gradient_penalty_weight=0.1)
    optimizer = torch.optim.Adam(loss.parameters(), 3e-3)
    batch = TensorDict({high: torch.randn(64, 4) + 2, low: torch.randn(64, 4) - 2}, [64])
    for _ in range(150):
        out = loss(batch)
        optimizer.zero_grad()
        sum(value for key, value in out.items() if key.startswith("loss_")).backward()
        optimizer.step()
    scores = network(batch[high]).mean(), network(batch[low]).mean()
    assert_close(torch.stack(scores), torch.tensor(labels), atol=0.25, rtol=0)


def test_keys_can_be_set_and_a_negative_weight_is_refused():
    loss = GAILDiscriminatorLoss(linear([1.0]))
    loss.set_keys(observation="agent")
    batch = TensorDict({"expert_observation": torch.ones(1, 1), "agent": -torch.ones(1, 1)}, [1])
    assert loss(batch)["loss_discriminator"] == 0
    for loss_class in (GAILDiscriminatorLoss, InitiationSetLoss):
        with pytest.raises(ValueError, match="must not be negative, got -1"):
            loss_class(linear([1.0]), gradient_penalty_weight=-1)
