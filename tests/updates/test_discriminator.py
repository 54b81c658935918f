"""What its update does to a discriminator."""

import math

import pytest
import torch
from small_skill import same, state_of

from tstar_rl.models.networks import make_discriminator
from tstar_rl.updates import (
    DiscriminatorSettings,
    DiscriminatorUpdate,
)


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


def test_what_is_logged_is_the_mean_over_steps_and_sides():
    one = {"initiation": torch.ones(4, 72), "termination": -torch.ones(4, 72)}
    other = {"initiation": 3 * torch.ones(4, 72), "termination": torch.zeros(4, 72)}
    labels, logs = {"initiation": 1.0, "termination": 0.0}, []
    for steps, sides in ((1, [one]), (1, [other]), (1, [one, other]), (3, [one, other])):
        torch.manual_seed(0)
        settings = DiscriminatorSettings(learning_rate=1e-9, steps=steps, gradient_penalty=0.0)
        logs.append(
            DiscriminatorUpdate("d", make_discriminator(72, hidden=(8,)), labels, settings).on_sides(sides)
        )
    mean = {name: (logs[0][name] + logs[1][name]) / 2 for name in logs[0]}
    assert logs[2] == pytest.approx(mean, rel=1e-3, abs=1e-6) and len(mean) > 3
    assert logs[3] == pytest.approx(mean, rel=1e-3, abs=1e-6) != pytest.approx(logs[0], rel=1e-2)


def test_the_losses_of_sides_count_by_their_weight():
    """Adam's steps would hide it: the gradients are compared."""
    gradients = []
    for weight in (0.5, 1.0):
        torch.manual_seed(0)
        network = make_discriminator(72, hidden=(8,))
        labels = {"initiation": 1.0, "termination": 0.0}
        update = DiscriminatorUpdate("d", network, labels, DiscriminatorSettings(steps=1))
        update.on_sides(two_sides(1.0, -1.0), weight=weight)
        gradients.append(torch.cat([each.grad.flatten() for each in network.parameters()]))
    torch.testing.assert_close(gradients[1], 2 * gradients[0])


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


@pytest.mark.parametrize("penalty", ["zero_at_first", "one_between"])
def test_points_between_are_drawn_where_the_penalty_is_there(penalty, monkeypatch):
    torch.manual_seed(0)
    settings = DiscriminatorSettings(steps=4, minibatch=50, penalty=penalty)
    update = DiscriminatorUpdate("f", make_discriminator(72, hidden=(8,)), {"a": 1.0, "b": 0.0}, settings)
    seen, forward = [], update.loss.forward
    monkeypatch.setattr(update.loss, "forward", lambda batch: seen.append(batch) or forward(batch))
    log = update(a=torch.randn(20, 72), b=torch.randn(30, 72))
    assert log["f_loss_gradient_penalty"] > 0 and len(seen) == 4
    shares = [batch["between"] for batch in seen if "between" in batch]
    assert len(shares) == (4 if penalty == "one_between" else 0)
    for share in shares:
        assert share.shape == (50, 1) and share.min() < 0.2 and share.max() > 0.8
    assert len({float(share.sum()) for share in shares}) == len(shares)


def test_an_empty_set_is_no_update():
    network = make_discriminator(72)
    before = state_of(network)
    update = DiscriminatorUpdate("f_phi", network, {"expert": 1.0, "agent": -1.0}, DiscriminatorSettings())
    assert update(expert=torch.zeros(0, 72), agent=torch.zeros(3, 72)) == {}
    assert same(before, state_of(network))


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


@pytest.mark.parametrize("penalty", ["zero_at_first", "one_between"])
def test_the_penalty_is_descended(penalty):
    gradients = []
    for weight in (1e-6, 10.0):
        torch.manual_seed(0)
        network, a, b = make_discriminator(72, hidden=(8,)), torch.randn(20, 72), torch.randn(30, 72)
        settings = DiscriminatorSettings(steps=1, minibatch=50, penalty=penalty, gradient_penalty=weight)
        DiscriminatorUpdate("f", network, {"a": 1.0, "b": 0.0}, settings)(a=a, b=b)
        found = [each.grad.flatten() for each in network.parameters() if each.grad is not None]
        gradients.append(torch.cat(found))
    assert not torch.allclose(*gradients, rtol=1e-2)
