"""SPiRL's skills and their prior: windows, training, decoders, and the agent on disk."""

import pytest
import torch
from spirl_agent import DECODERS, make_agent
from tensordict import TensorDict
from torch.testing import assert_close
from torchrl.envs import ExplorationType, set_exploration_type

from tstar_rl.chaining.skill import NetworkSettings, Skill
from tstar_rl.config.build import load_skill
from tstar_rl.spirl.agent import SkillAgent
from tstar_rl.spirl.skill_model import SkillModelSettings
from tstar_rl.spirl.skill_model_loss import SkillModelLoss
from tstar_rl.spirl.train_skill_model import SkillModelTraining, train_skill_model, windows


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
        with pytest.raises(ValueError, match="no episode has 5 steps; the longest has 4"):
            windows(self.observations, self.actions, self.lengths, 5, pad=False)


class TestSkillModel:
    @pytest.mark.parametrize("decoder", DECODERS)
    def test_a_decoder_gives_the_same_actions_step_by_step(self, decoder):
        model = make_agent(decoder).model
        skill, observations = torch.randn(5, 3), torch.randn(5, 4, 72)
        together = model.decoder.decode(skill, observations)
        for k in range(4):
            alone = model.decoder(skill, observations[:, k], torch.full((5,), k))
            assert_close(alone, together[:, k])

    def test_an_open_loop_does_not_see_states_and_a_closed_loop_does(self):
        skill, observations = torch.randn(5, 3), torch.randn(5, 4, 72)
        for decoder, same in (("open_loop", True), ("closed_loop", False)):
            decode = make_agent(decoder).model.decoder.decode
            assert torch.equal(decode(skill, observations), decode(skill, observations + 1)) is same

    @pytest.mark.parametrize("decoder", DECODERS)
    def test_training_finds_the_skills_and_the_states_they_belong_to(self, decoder):
        """Two kinds of windows, all ones and all minus ones, told apart by the state."""
        sign = torch.tensor([1.0, -1.0]).repeat(64)
        state = sign.reshape(-1, 1, 1).expand(-1, 4, 72)
        data = TensorDict({"observation": state, "action": state[..., :9]}, [128])
        settings = SkillModelTraining(epochs=40, minibatch=32, learning_rate=1e-2, log_every=40)
        (row,) = list(train_skill_model(make_agent(decoder).model, data[:96], data[96:], settings))
        assert row["held_out_variance"] == pytest.approx(1.0)
        assert row["held_out_error"] < 0.05 and row["held_out_prior_error"] < 0.1

    def test_the_prior_does_not_pull_at_the_posterior(self):
        model = make_agent().model
        out = SkillModelLoss(model)(
            TensorDict({"observation": torch.randn(2, 4, 72), "action": torch.randn(2, 4, 9)}, [2])
        )
        out["loss_prior"].backward()
        assert all(p.grad is None for p in [*model.posterior.parameters(), *model.decoder.parameters()])
        assert any(p.grad.abs().sum() > 0 for p in model.prior.parameters())


def test_an_agent_comes_back_from_disk(tmp_path):
    agent = make_agent("closed_loop")
    agent.normalizer.fit(torch.randn(50, 72) * 3)
    agent.save(tmp_path / "agent", recipe="spirl")
    found = load_skill(tmp_path / "agent", task="table_lack")
    assert isinstance(found, SkillAgent) and found.settings == agent.settings and found.subtask == 0
    td = TensorDict({"observation": torch.randn(4, 72), "step_count": torch.zeros(4, 1)}, [4])
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        assert_close(found.policy(td.clone())["action"], agent.policy(td.clone())["action"])
    Skill("table_lack", 1, NetworkSettings(hidden=(8,))).save(tmp_path / "skill")
    assert isinstance(load_skill(tmp_path / "skill"), Skill)


def test_an_unknown_decoder_is_named():
    with pytest.raises(ValueError, match="'open_loop' or 'closed_loop', got 'loop'"):
        SkillModelSettings(decoder="loop")
