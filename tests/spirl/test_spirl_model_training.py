"""SPiRL's first stage: windows of demonstrations, and the latent model fitted to them."""

from types import SimpleNamespace

import pytest
import torch
from spirl_agent import DECODERS, make_agent
from tensordict import TensorDict
from torch.testing import assert_close

from tstar_rl.spirl import ModelTrainingSettings, split_windows, train_latent_model
from tstar_rl.spirl.model_training import LatentModelLoss, windows


class TestWindows:
    observations = torch.arange(7.0).unsqueeze(-1).expand(-1, 72)
    actions = 10 + torch.arange(7.0).unsqueeze(-1).expand(-1, 9)
    lengths = torch.tensor([4, 3])

    def test_they_stay_inside_an_episode(self):
        found = windows(self.observations, self.actions, self.lengths, 3, pad=False)
        assert found["observation"][..., 0].tolist() == [[0, 1, 2], [1, 2, 3], [4, 5, 6]]
        assert found["action"][..., 0].tolist() == [[10, 11, 12], [11, 12, 13], [14, 15, 16]]

    def test_padded_ones_repeat_the_last_step(self):
        found = windows(self.observations, self.actions, self.lengths, 3, pad=True)["action"][..., 0]
        assert found.tolist()[2:4] == [[12, 13, 13], [13, 13, 13]]
        assert len(found) == 7

    def test_episodes_that_are_too_short_are_named(self):
        with pytest.raises(ValueError, match="no episode has the 5 steps of .*; the longest has 4"):
            windows(self.observations, self.actions, self.lengths, 5, pad=False)

    def test_the_last_episodes_are_held_out(self):
        expert = self.expert(self.lengths)
        training, held_out = split_windows(expert, 3, ModelTrainingSettings(held_out=0.1, pad=False))
        assert training["observation"][..., 0].tolist() == [[0, 1, 2], [1, 2, 3]]
        assert held_out["action"][..., 0].tolist() == [[14, 15, 16]]

    def test_one_episode_cannot_be_split(self):
        with pytest.raises(ValueError, match=r"held_out=0.1 of 1 episodes leaves none to train on"):
            split_windows(self.expert(torch.tensor([7])), 3, ModelTrainingSettings())

    def expert(self, lengths):
        class Expert(SimpleNamespace):
            def __len__(self):
                return len(self.lengths)

        return Expert(observations=self.observations, actions=self.actions, lengths=lengths)


@pytest.mark.parametrize("decoder", DECODERS)
def test_training_finds_the_latents_and_the_states_they_belong_to(decoder):
    """Two kinds of windows, all ones and all minus ones, told apart by the state."""
    sign = torch.tensor([1.0, -1.0]).repeat(64)
    state = sign.reshape(-1, 1, 1).expand(-1, 4, 72)
    data = TensorDict({"observation": state, "action": state[..., :9]}, [128])
    settings = ModelTrainingSettings(epochs=40, minibatch=32, learning_rate=1e-2, log_every=40)
    (row,) = list(train_latent_model(make_agent(decoder).model, data[:96], data[96:], settings))
    assert row["held_out_variance"] == pytest.approx(1.0)
    assert row["held_out_error"] < 0.05 and row["held_out_prior_error"] < 0.1


def test_with_a_cosine_the_second_of_two_epochs_moves_half_as_far():
    torch.manual_seed(0)
    data = TensorDict({"observation": torch.randn(32, 4, 72), "action": torch.randn(32, 4, 9)}, [32])
    start = make_agent().model.state_dict()

    def moves(cosine: bool) -> list[torch.Tensor]:
        """Of all parameters in each epoch, which has one minibatch and the same draws."""
        agent = make_agent()
        agent.model.load_state_dict(start)
        settings = ModelTrainingSettings(epochs=2, minibatch=32, log_every=1, cosine_decay=cosine)
        torch.manual_seed(1)
        last, found = flat(agent.model), []
        for _ in train_latent_model(agent.model, data, data, settings):
            torch.manual_seed(2)
            found.append(flat(agent.model) - last)
            last = flat(agent.model)
        return found

    def flat(model):
        return torch.nn.utils.parameters_to_vector(model.parameters()).detach().double()

    (first, second), (same, half) = moves(False), moves(True)
    assert torch.equal(first, same)
    assert_close(half, second / 2, rtol=0, atol=1e-7)


def test_the_prior_does_not_pull_at_the_posterior():
    model = make_agent().model
    out = LatentModelLoss(model)(
        TensorDict({"observation": torch.randn(2, 4, 72), "action": torch.randn(2, 4, 9)}, [2])
    )
    out["loss_prior"].backward()
    assert all(p.grad is None for p in [*model.posterior.parameters(), *model.decoder.parameters()])
    assert any(p.grad.abs().sum() > 0 for p in model.prior.parameters())


def test_one_seed_gives_one_model():
    data = TensorDict({"observation": torch.randn(40, 4, 72), "action": torch.randn(40, 4, 9)}, [40])
    settings = ModelTrainingSettings(epochs=2, minibatch=16, log_every=1)
    rows = []
    for seed in (3, 3, 4):
        model = make_agent().model
        rows.append(list(train_latent_model(model, data[:30], data[30:], settings, seed)))
    assert rows[0] == rows[1] != rows[2] and [row["epoch"] for row in rows[0]] == [1, 2]
