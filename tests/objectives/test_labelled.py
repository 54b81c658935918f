"""The loss of labels on numbers worked by hand, and the updates that descend it."""

import copy

import pytest
import torch
from tensordict import TensorDict
from torch import nn
from torch.testing import assert_close

from tstar_rl.models.networks import Discriminator, make_discriminator
from tstar_rl.models.normalizer import Normalizer, Standardizer
from tstar_rl.objectives import LabelledLoss
from tstar_rl.signal_equations import outcome_loss, squared_error_loss
from tstar_rl.updates import LabelledSettings, LabelledUpdate


def linear(weights: list[float], normalizer=None) -> Discriminator:
    network = nn.Linear(len(weights), 1, bias=False)
    network.weight.data = torch.tensor([weights])
    return Discriminator(network, normalizer)


def test_the_loss_on_a_linear_network():
    # Scores 3 and -1 against 1 and 0: squared errors 4 and 1, mean 2.5.
    rows = TensorDict(
        {"observation": torch.tensor([[1.0], [-1 / 3]]), "label": torch.tensor([[1.0], [0.0]])}, [2]
    )
    out = LabelledLoss(linear([3.0]), squared_error_loss)(rows)
    assert_close(out["loss_label"], torch.tensor(2.5))
    assert_close(out["score"], torch.tensor(1.0))


def test_noise_is_added_behind_the_normaliser():
    normalizer = Normalizer(1)
    normalizer.fit(torch.tensor([[-10.0], [10.0]]))  # deviation 10
    rows = TensorDict({"observation": torch.tensor([[10.0]]), "label": torch.tensor([[0.0]])}, [1])
    rows["noise"] = torch.tensor([[2.0]])
    out = LabelledLoss(linear([1.0], normalizer), squared_error_loss)(rows)
    assert_close(out["loss_label"], torch.tensor(9.0))  # (1 + 2)^2


def outcomes(number: int = 400) -> tuple[torch.Tensor, torch.Tensor]:
    """A tilt of a thousandth decides the outcome; other numbers vary more and say nothing."""
    generator = torch.Generator().manual_seed(0)
    states = torch.randn(number, 72, generator=generator)
    states[:, 5] = 1 + 1e-3 * torch.randn(number, generator=generator)
    return states, (states[:, 5] > 1).float()


def trained(floor: float | None, labels: torch.Tensor, states: torch.Tensor) -> Discriminator:
    torch.manual_seed(0)
    normalizer = Normalizer(72) if floor is None else Standardizer(72, floor)
    normalizer.fit(states)
    network = make_discriminator(72, hidden=(32,), normalizer=normalizer)
    settings = LabelledSettings(steps=300, learning_rate=3e-3, minibatch=64, floor=floor)
    LabelledUpdate("f", network, outcome_loss, settings)(states, labels)
    return network


def gap(network: Discriminator, states: torch.Tensor, good: torch.Tensor) -> float:
    """How much higher good states score than bad ones."""
    scores = network(states).detach().sigmoid().squeeze(-1)
    return float(scores[good > 0].mean() - scores[good == 0].mean())


def test_it_learns_which_states_lead_to_success_and_the_labels_say_which_way():
    states, good = outcomes()
    fresh, truth = outcomes(800)[0][400:], outcomes(800)[1][400:]
    assert gap(trained(1e-4, good, states), fresh, truth) > 0.5
    assert gap(trained(1e-4, 1 - good, states), fresh, truth) < -0.5


def test_a_low_floor_lets_it_see_what_the_skills_normaliser_hides():
    states, good = outcomes()
    fresh, truth = outcomes(800)[0][400:], outcomes(800)[1][400:]
    assert gap(trained(None, good, states), fresh, truth) < 0.2  # the floor of .02 makes .05 of a deviation


def test_shares_are_learned_as_they_are():
    """Of states that are all alike a quarter of the rest of the chain is done: F says .25."""
    network = trained(1e-4, torch.full((400,), 0.25), torch.zeros(400, 72))
    assert float(network(torch.zeros(1, 72)).detach().sigmoid()) == pytest.approx(0.25, abs=0.02)


def test_what_is_logged_and_what_is_refused():
    update = LabelledUpdate("f", make_discriminator(72), outcome_loss, LabelledSettings(steps=1, floor=None))
    log = update(torch.randn(4, 72), torch.tensor([1.0, 1.0, 0.0, 1.0]))
    assert log["f_label"] == 0.75 and log["f_states"] == 4 and log.keys() >= {"f_loss", "f_score"}
    assert update(torch.zeros(0, 1), torch.zeros(0)) == {}
    for labels in (
        torch.ones(3),
        torch.ones(4, 1),
    ):  # which would be compared with every state of a minibatch
        with pytest.raises(
            ValueError, match=r"for each observation, \(n,\); got 4 observations and labels \("
        ):
            update(torch.randn(4, 72), labels)


def test_what_is_logged_is_the_mean_over_steps(monkeypatch):
    update = LabelledUpdate(
        "f", linear([1.0] * 72), squared_error_loss, LabelledSettings(steps=3, floor=None)
    )
    of_step = iter((torch.tensor(1.0), torch.tensor(2.0), torch.tensor(6.0)))

    def forward(batch):
        of_this = next(of_step)
        loss = of_this + 0.0 * sum(each.sum() for each in update.loss.parameters())
        return TensorDict({"loss_label": loss, "score": 10 * of_this})

    monkeypatch.setattr(update.loss, "forward", forward)
    log = update(torch.ones(4, 72), torch.zeros(4))
    assert (log["f_loss"], log["f_score"]) == (3.0, 30.0)


@pytest.mark.parametrize("deviation", [0.1, 0.4])
def test_the_loss_gets_rows_with_their_labels_and_noise_of_the_deviation_asked_for(deviation, monkeypatch):
    settings = LabelledSettings(steps=3, noise=deviation)
    update = LabelledUpdate("f", make_discriminator(72, hidden=(8,)), outcome_loss, settings)
    seen, forward = [], update.loss.forward
    monkeypatch.setattr(update.loss, "forward", lambda batch: seen.append(batch) or forward(batch))
    states = torch.arange(9.0).unsqueeze(-1).expand(9, 72)
    update(states, (states[:, 0] > 4).float())
    assert len(seen) == 3
    for batch in seen:
        assert torch.equal(batch["label"], (batch["observation"][:, :1] > 4).float())
        assert batch["noise"].shape == batch["observation"].shape == (256, 72)
        assert float(batch["noise"].std()) == pytest.approx(deviation, rel=0.03)


def test_weights_decay_where_the_loss_says_nothing():
    """A step of AdamW without a gradient leaves 1 - .1 * .2 of each."""
    network = make_discriminator(72, hidden=(8,))
    before = copy.deepcopy(network.state_dict())
    settings = LabelledSettings(learning_rate=0.1, weight_decay=0.2, steps=1)
    LabelledUpdate("f", network, lambda scores, labels: 0 * scores.mean(), settings)(
        torch.randn(9, 72), torch.ones(9)
    )
    for name, value in network.state_dict().items():
        assert_close(value, 0.98 * before[name])


def test_an_update_goes_on_from_its_state():
    states, good = outcomes()
    settings = LabelledSettings(steps=3)
    found = []
    for seed in (0, 7):
        torch.manual_seed(0)
        network = make_discriminator(72, hidden=(8,), normalizer=Standardizer(72, 1e-4))
        update = LabelledUpdate("f", network, outcome_loss, settings, seed)
        if found:
            network.load_state_dict(found[0][0])
            update.load_state_dict(found[0][1])
        else:
            update(states, good)
            found.append((copy.deepcopy(network.state_dict()), copy.deepcopy(update.state_dict())))
        found.append(update(states, good))
    assert found[1] == found[2]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"steps": 0}, "LabelledSettings.steps must be at least 1, got 0"),
        ({"noise": -0.1}, "LabelledSettings.noise must be not negative, got -0.1"),
        ({"floor": 0.0}, "LabelledSettings.floor must be positive, got 0.0"),
    ],
)
def test_a_number_out_of_range_is_named(values, message):
    with pytest.raises(ValueError, match=message):
        LabelledSettings(**values)
