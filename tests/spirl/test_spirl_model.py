"""SPiRL's networks: what a decoder sees, and settings that are refused."""

import pytest
import torch
from spirl_agent import DECODERS, make_agent
from tensordict import TensorDict
from torch.testing import assert_close

from tstar_rl.spirl import LatentModelSettings


class TestDecoders:
    @pytest.mark.parametrize("decoder", DECODERS)
    def test_a_decoder_gives_the_same_actions_step_by_step(self, decoder):
        model = make_agent(decoder).model
        latent, observations = torch.randn(5, 3), torch.randn(5, 4, 72)
        together = model.decoder.decode(latent, observations)
        for k in range(4):
            alone = model.decoder(latent, observations[:, k], torch.full((5,), k))
            assert_close(alone, together[:, k])

    def test_an_open_loop_does_not_see_states_and_a_closed_loop_does(self):
        latent, observations = torch.randn(5, 3), torch.randn(5, 4, 72)
        for decoder, same in (("open_loop", True), ("closed_loop", False)):
            decode = make_agent(decoder).model.decoder.decode
            assert torch.equal(decode(latent, observations), decode(latent, observations + 1)) is same


def test_errors_are_those_of_the_means():
    model = make_agent().model
    windows = TensorDict({"observation": torch.randn(5, 4, 72), "action": torch.randn(5, 4, 9)}, [5])
    errors = model.errors(windows)
    loc, _ = model.prior(windows["observation"][:, 0])
    decoded = model.decoder.decode(loc, windows["observation"])
    wanted = (decoded - windows["action"]).square().mean()
    assert errors["held_out_prior_error"] == pytest.approx(wanted.item())
    assert errors["held_out_error"] != pytest.approx(wanted.item())
    variance = windows["action"].reshape(20, 9).var(0, unbiased=False).mean()
    assert errors["held_out_variance"] == pytest.approx(float(variance))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"decoder": "loop"}, "must be one of open_loop, closed_loop; got 'loop'"),
        ({"horizon": 0}, "LatentModelSettings.horizon must be at least 1, got 0"),
        ({"latent_dim": 0}, "LatentModelSettings.latent_dim must be at least 1, got 0"),
    ],
)
def test_settings_out_of_range_are_named(values, message):
    with pytest.raises(ValueError, match=message):
        LatentModelSettings(**values)
