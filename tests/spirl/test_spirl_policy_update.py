"""SPiRL's second stage: the regularised loss on numbers worked by hand, and its updates."""

import copy

import pytest
import torch
from spirl_agent import make_agent
from tensordict import TensorDict
from torch import nn
from torch.testing import assert_close
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer

from tstar_rl.spirl import LatentPolicySettings, LatentPolicyUpdate
from tstar_rl.spirl.model import make_latent_actor, make_latent_critic
from tstar_rl.spirl.policy_update import PriorRegularisedSACLoss


class Fixed(nn.Module):
    """A Gaussian at the same place whatever the state, for a policy or a prior."""

    def __init__(self, loc, scale):
        super().__init__()
        self.loc, self.scale = nn.Parameter(torch.tensor(loc)), torch.tensor(scale)

    def forward(self, obs):
        return self.loc.expand(*obs.shape[:-1], -1), self.scale.expand(*obs.shape[:-1], -1)


def make_loss(loc, scale, prior_loc, prior_scale, alpha, target=5.0, critic_loss="smooth_l1"):
    class Constant(nn.Module):
        def __init__(self):
            super().__init__()
            self.value = nn.Parameter(torch.tensor([2.0]))

        def forward(self, obs, latent):
            return self.value.expand(*obs.shape[:-1], 1)

    loss = PriorRegularisedSACLoss(
        make_latent_actor(Fixed(loc, scale)),
        make_latent_critic(Constant()),
        Fixed(prior_loc, prior_scale),
        target,
        alpha,
        critic_loss,
    )
    loss.make_value_estimator(gamma=0.9)
    return loss


class TestPriorRegularisedSAC:
    batch = TensorDict(
        {
            "observation": torch.zeros(2, 72),
            "latent": torch.zeros(2, 1),
            "next": {
                "observation": torch.zeros(2, 72),
                "reward": torch.tensor([[1.0], [1.0]]),
                "done": torch.tensor([[False], [True]]),
                "terminated": torch.tensor([[False], [True]]),
            },
        },
        [2],
    )

    def test_on_numbers_worked_by_hand(self):
        # KL(N(1, 1) || N(3, 1)) = 2. V = 2 - 0.5 * 2 = 1. Targets 1 + 0.9 * 1 = 1.9 and, terminated, 1.
        loss = make_loss([1.0], [1.0], [3.0], [1.0], alpha=0.5)
        # The second critic's 5 counts nowhere but in its own loss: of two, the smaller one is believed.
        for name, values in loss.named_parameters():
            if "qvalue" in name:
                values.data.copy_(torch.tensor([[2.0], [5.0]]))
        for values in loss.target_qvalue_network_params.values(True, True):
            values.data.copy_(torch.tensor([[2.0], [5.0]]))
        assert_close(loss._compute_target_v2(self.batch), torch.tensor([1.9, 1.0]))
        out = loss(self.batch.clone())
        assert_close(out["loss_actor"].detach(), torch.tensor(-1.0))
        assert_close(out["entropy"], torch.tensor(-2.0))
        assert_close(out["loss_alpha"].detach(), torch.log(torch.tensor(0.5)) * 3.0)  # log alpha (5 - 2)

    @pytest.mark.parametrize(("critic_loss", "expected"), [("smooth_l1", 0.505), ("l2", 1.01)])
    def test_the_critics_loss(self, critic_loss, expected):
        # Q = 2 is .1 and 1 away from the targets; smooth-L1 is half the square up to 1. Means of two, two critics.
        loss = make_loss([1.0], [1.0], [3.0], [1.0], alpha=0.5, critic_loss=critic_loss)
        assert_close(loss(self.batch.clone())["loss_qvalue"].detach(), torch.tensor(expected))

    def test_the_actor_is_drawn_to_the_prior(self):
        loss = make_loss([1.0], [1.0], [3.0], [1.0], alpha=0.5)
        loss(self.batch.clone())["loss_actor"].backward()
        (grad,) = [p.grad for p in loss.actor_network_params.parameters()]
        assert_close(grad, torch.tensor([-1.0]))  # alpha (1 - 3): descent goes up, to 3

    def test_the_prior_is_not_trained(self):
        agent = make_agent()
        own = {id(p) for p in LatentPolicyUpdate(agent, LatentPolicySettings()).loss.parameters()}
        assert not own & {id(p) for p in agent.model.parameters()}

    def test_a_target_that_is_not_positive_is_refused(self):
        with pytest.raises(ValueError, match="must be positive, got 0"):
            make_loss([1.0], [1.0], [3.0], [1.0], alpha=0.5, target=0)


def transitions(agent, n=64):
    """Latents of which the first number is the reward; every episode is one latent long."""
    torch.manual_seed(1)
    latent, yes = torch.randn(n, agent.settings.latent_dim), torch.ones(n, 1, dtype=torch.bool)
    following = {
        "observation": torch.zeros(n, 72),
        "reward": latent[:, :1].clone(),
        "done": yes,
        "terminated": yes,
    }
    buffer = TensorDictReplayBuffer(storage=LazyTensorStorage(n))
    buffer.extend(TensorDict({"observation": torch.zeros(n, 72), "latent": latent, "next": following}, [n]))
    return buffer


class TestLatentPolicyUpdate:
    settings = LatentPolicySettings(
        critic_hidden=(16,), first=32, minibatch=32, learning_rate=1e-2, target_divergence=1.0, alpha=0.5
    )

    def make(self, **changes):
        agent = make_agent()
        agent.start_from_prior()
        settings = LatentPolicySettings(**{**vars(self.settings), **changes})
        return agent, LatentPolicyUpdate(agent, settings)

    def test_the_policy_moves_to_what_pays(self):
        agent, update = self.make()
        for _ in range(3):
            update(transitions(agent), 50)
        loc, _ = agent.network(torch.zeros(1, 72))
        prior_loc, _ = agent.model.prior(torch.zeros(1, 72))
        assert loc[0, 0] > prior_loc[0, 0] + 0.2

    @pytest.mark.parametrize(("target", "rises"), [(1e-3, True), (1e3, False)])
    def test_alpha_goes_where_the_divergence_says(self, target, rises):
        agent, update = self.make(target_divergence=target)
        update(transitions(agent), 50)
        assert (update.loss.log_alpha.exp() > 0.5) == rises

    def test_it_waits_for_data_and_for_the_critics(self):
        agent, update = self.make(first=100)
        assert update(transitions(agent), 50) == {}
        agent, update = self.make(critic_warmup=50)
        before = [p.clone() for p in agent.network.parameters()]
        update(transitions(agent), 50)
        assert update.minibatches == 50
        assert all(torch.equal(a, b) for a, b in zip(before, agent.network.parameters(), strict=True))

    def test_the_target_critics_follow_the_critics(self):
        agent, update = self.make(tau=1.0)
        before = update.loss.target_qvalue_network_params.clone()
        update(transitions(agent), 3)
        critics, targets = update.loss.qvalue_network_params.data, update.loss.target_qvalue_network_params
        assert_close(targets, critics, rtol=0, atol=0)
        assert not (targets == before).all()

    def test_its_settings_reach_the_loss_and_the_targets(self):
        agent, update = self.make(gamma=0.3, tau=0.25, critic_loss="l2", critic_warmup=50)
        assert float(update.loss.value_estimator.gamma) == pytest.approx(0.3)
        assert update.loss.loss_function == "l2"
        before, alpha = update.loss.target_qvalue_network_params.clone(), update.loss.log_alpha.clone()
        update(transitions(agent), 1)
        now = update.loss.qvalue_network_params.data
        assert_close(update.loss.target_qvalue_network_params, before * 0.75 + now * 0.25)
        assert torch.equal(update.loss.log_alpha, alpha)  # it waits for the critics as the actor does

    def test_gradients_are_limited(self):
        """Adam divides by their size, but for its epsilon: only gradients far below that move nothing."""
        agent, update = self.make(max_grad_norm=1e-12)
        before = [p.clone() for p in (*agent.network.parameters(), *update.parameters["qvalue"])]
        update(transitions(agent), 5)
        after = (*agent.network.parameters(), *update.parameters["qvalue"])
        assert max((a - b).abs().max() for a, b in zip(before, after, strict=True)) < 1e-4
        agent, update = self.make(max_grad_norm=None)
        before = [p.clone() for p in update.parameters["qvalue"]]
        update(transitions(agent), 5)
        assert (
            max((a - b).abs().max() for a, b in zip(before, update.parameters["qvalue"], strict=True)) > 1e-2
        )

    def test_it_goes_on_from_its_state(self):
        agent, update = self.make()
        update(transitions(agent), 10)
        other, resumed = self.make()
        other.load_state_dict(agent.state_dict())
        resumed.load_state_dict(copy.deepcopy(update.state_dict()))  # as from a file
        logs = [u(transitions(a), 10) for a, u in ((agent, update), (other, resumed))]
        assert logs[0] == logs[1]

    def test_a_part_of_a_minibatch_is_owed_to_later_calls_also_after_a_stop(self):
        agent, update = self.make(updates=0.3)
        buffer = transitions(agent)
        for _ in range(5):
            update(buffer, 1)
        _, resumed = self.make(updates=0.3)
        resumed.load_state_dict(copy.deepcopy(update.state_dict()))
        for _ in range(5):
            resumed(buffer, 1)
        assert update.minibatches in (1, 2) and resumed.minibatches == 3

    def test_a_state_from_before_owes_nothing(self):
        agent, update = self.make()
        update(transitions(agent), 10)
        state = copy.deepcopy(update.state_dict())
        state.pop("owed", None)
        _, resumed = self.make()
        resumed.load_state_dict(state)
        assert (resumed.minibatches, resumed.owed) == (10, 0.0)
