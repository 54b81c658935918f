"""The discriminators' loss on numbers worked by hand, and that training with it separates."""

import pytest
import torch
from tensordict import TensorDict
from torch import nn
from torch.testing import assert_close

from tstar_rl.models.networks import Discriminator, make_discriminator
from tstar_rl.models.normalizer import Normalizer
from tstar_rl.objectives import DiscriminatorLoss

F_PHI, D_OMEGA = {"expert": 1.0, "agent": -1.0}, {"initiation": 1.0, "termination": 0.0}


def linear(weights: list[float], normalizer=None) -> Discriminator:
    network = nn.Linear(len(weights), 1, bias=False)
    network.weight.data = torch.tensor([weights])
    return Discriminator(network, normalizer)


def batch(**observations: list[list[float]]) -> TensorDict:
    rows = {f"{kind}_observation": torch.tensor(values) for kind, values in observations.items()}
    return TensorDict(rows, [len(next(iter(rows.values())))])


def test_the_loss_of_f_phi_on_a_linear_discriminator():
    # f(x) = 3 x0 + 4 x1. Experts: f = 3 and 1, agents: f = 0 and -4. Loss: (4 + 0) / 2 + (1 + 9) / 2 = 7.
    # The gradient is (3, 4) everywhere: penalty 10 * 0.5 * 25 = 125.
    rows = batch(expert=[[1.0, 0.0], [-1.0, 1.0]], agent=[[0.0, 0.0], [0.0, -1.0]])
    out = DiscriminatorLoss(linear([3.0, 4.0]), F_PHI)(rows)
    assert_close(out["loss_discriminator"], torch.tensor(7.0))
    assert_close(out["loss_gradient_penalty"], torch.tensor(125.0))
    assert_close(out["expert_score"], torch.tensor(2.0))
    assert_close(out["agent_score"], torch.tensor(-2.0))


def test_the_loss_of_d_omega_on_a_linear_discriminator():
    # d(x) = 0.5 x. Initiation: d = 1 and 0.5, termination: d = 0.5 and -1. Loss: 0.25 / 2 + 1.25 / 2 = 0.75.
    rows = batch(initiation=[[2.0], [1.0]], termination=[[1.0], [-2.0]])
    out = DiscriminatorLoss(linear([0.5]), D_OMEGA, gradient_penalty_weight=0.0)(rows)
    assert_close(out["loss_discriminator"], torch.tensor(0.75))
    assert out["loss_gradient_penalty"] == 0
    penalised = DiscriminatorLoss(linear([0.5]), D_OMEGA)(rows)
    assert_close(penalised["loss_gradient_penalty"], torch.tensor(1.25))  # 10 * 0.5 * 0.25


def test_the_penalty_is_on_the_normalised_observation():
    normalizer = Normalizer(2)
    normalizer.fit(torch.tensor([[-0.1, -5.0], [0.1, 5.0]]))  # deviations 0.1 and 5
    rows = batch(expert=[[0.0, 0.0]], agent=[[0.0, 0.0]])
    out = DiscriminatorLoss(linear([3.0, 4.0], normalizer), F_PHI)(rows)
    assert_close(out["loss_gradient_penalty"], torch.tensor(125.0))


class Square(nn.Module):
    """x -> x^2, whose gradient is 2 x."""

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return x.square().sum(-1, keepdim=True)


def test_the_penalty_of_the_released_code_is_between_the_kinds():
    """Points 1, 2 and 4: gradients 2, 4 and 8, at distances of 1, 3 and 7 from one: 10 (1 + 9 + 49) / 3."""
    rows = batch(expert=[[1.0], [1.0], [1.0]], agent=[[5.0], [5.0], [5.0]])
    rows["between"] = torch.tensor([[0.0], [0.25], [0.75]])
    out = DiscriminatorLoss(Discriminator(Square()), F_PHI)(rows)
    assert_close(out["loss_gradient_penalty"], torch.tensor(590 / 3))
    assert_close(
        out["loss_discriminator"], torch.tensor(26.0**2)
    )  # of the states themselves: 0 and (25 + 1)^2
    assert_close(out["expert_score"], torch.tensor(1.0))
    del rows["between"]  # at the experts' states, half of 2^2
    out = DiscriminatorLoss(Discriminator(Square()), F_PHI)(rows)
    assert_close(out["loss_gradient_penalty"], torch.tensor(20.0))


def test_points_between_are_of_normalised_observations():
    """The network reads -1 and 1 of 10 and 12; in the middle its gradient is 0, at a distance of 1 from one."""
    normalizer = Normalizer(1)
    normalizer.fit(torch.tensor([[10.0], [12.0]]))
    rows = batch(expert=[[10.0]], agent=[[12.0]])
    rows["between"] = torch.tensor([[0.5]])
    out = DiscriminatorLoss(Discriminator(Square(), normalizer), F_PHI)(rows)
    assert_close(out["loss_gradient_penalty"], torch.tensor(10.0), atol=1e-3, rtol=0)


@pytest.mark.parametrize("labels", [F_PHI, D_OMEGA], ids=["f_phi", "d_omega"])
def test_training_approaches_the_labels(labels):
    torch.manual_seed(0)
    network = make_discriminator(4, hidden=(32, 32))
    loss = DiscriminatorLoss(network, labels, gradient_penalty_weight=0.1)
    optimizer = torch.optim.Adam(loss.parameters(), 3e-3)
    high, low = torch.randn(64, 4) + 2, torch.randn(64, 4) - 2
    rows = TensorDict({f"{kind}_observation": x for kind, x in zip(labels, (high, low), strict=True)}, [64])
    for _ in range(150):
        out = loss(rows)
        optimizer.zero_grad()
        sum(value for key, value in out.items() if key.startswith("loss_")).backward()
        optimizer.step()
    scores = torch.stack([network(high).mean(), network(low).mean()])
    assert_close(scores, torch.tensor(list(labels.values())), atol=0.25, rtol=0)


def test_what_is_no_discriminator_is_refused():
    with pytest.raises(ValueError, match="must not be negative, got -1"):
        DiscriminatorLoss(linear([1.0]), F_PHI, gradient_penalty_weight=-1)
    with pytest.raises(ValueError, match="labels of two kinds of states, got {'expert': 1.0}"):
        DiscriminatorLoss(linear([1.0]), {"expert": 1.0})
