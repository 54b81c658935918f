"""What PPO learns from: returns, the critic's targets and advantages."""

import copy

import pytest
import torch
from small_skill import small_skill
from tensordict import TensorDict
from torchrl.objectives.value import GAE

from tstar_rl.models.return_scale import ReturnScale
from tstar_rl.updates import PolicyUpdate, PPOSettings


def test_returns_so_far_are_those_of_episodes_that_run_on():
    """One simulation runs on with a return of 3 so far; the other is new, and so is its episode."""
    skill = small_skill()
    settings = PPOSettings(normalize_returns=True, gamma=0.5)
    update = PolicyUpdate(skill.policy, skill.value, settings, skill.return_scale)
    no = torch.zeros(2, 1, 1, dtype=torch.bool)
    step = {"observation": torch.randn(2, 1, 72), "reward": torch.ones(2, 1, 1), "done": no, "terminated": no}
    step["step_count"] = torch.tensor([5, 1]).reshape(2, 1, 1)
    rollout = TensorDict({"observation": torch.randn(2, 1, 72), "next": step}, [2, 1])
    rollout.update({"action": torch.zeros(2, 1, 9), "action_log_prob": torch.zeros(2, 1)})
    update.carried = torch.tensor([[3.0], [3.0]])
    update._with_advantage(rollout)
    assert update.carried.tolist() == [[2.5], [1.0]]  # half of what was, and 1
    state = copy.deepcopy(update.state_dict())
    del state["carried"]
    update.load_state_dict(state)
    assert update.carried.tolist() == [[2.5], [1.0]]
    update._with_advantage(rollout[:1])  # of another number of simulations: these have no returns so far
    assert update.carried.tolist() == [[1.0]]


@pytest.mark.parametrize(("normalized", "expected"), [(True, [1.0, 3.0]), (False, [2.0, 6.0])])
def test_the_critic_learns_rewards_divided_by_the_deviation_of_returns(normalized, expected):
    """Two episodes of one step, which end: returns are the rewards 2 and 6, their deviation is 2."""
    skill = small_skill()
    settings = PPOSettings(normalize_returns=normalized)
    update = PolicyUpdate(skill.policy, skill.value, settings, skill.return_scale)
    yes = torch.ones(2, 1, 1, dtype=torch.bool)
    step = {"observation": torch.randn(2, 1, 72), "reward": torch.tensor([2.0, 6.0]).reshape(2, 1, 1)}
    rollout = TensorDict(
        {"observation": torch.randn(2, 1, 72), "next": {**step, "done": yes, "terminated": yes}}, [2, 1]
    )
    rollout.update({"action": torch.zeros(2, 1, 9), "action_log_prob": torch.zeros(2, 1)})
    assert update._with_advantage(rollout)["value_target"].flatten().tolist() == pytest.approx(expected)


def test_values_of_next_states_are_looked_at_once_and_right():
    """As TorchRL's GAE on both states of every step, where episodes end and are truncated in the middle."""
    torch.manual_seed(0)
    skill = small_skill()
    sequence, done = torch.randn(5, 8, 72), torch.rand(5, 7, 1) < 0.3
    following = sequence[:, 1:].clone()
    following[done.squeeze(-1)] = torch.randn(int(done.sum()), 72)
    step = {"observation": following, "reward": torch.randn(5, 7, 1), "done": done}
    step["terminated"] = done & (torch.rand(5, 7, 1) < 0.5)
    rollout = TensorDict({"observation": sequence[:, :-1], "next": step}, [5, 7])
    update = PolicyUpdate(skill.policy, skill.value, PPOSettings(gamma=0.9, gae_lambda=0.8), ReturnScale())
    expected = GAE(gamma=0.9, lmbda=0.8, value_network=skill.value, deactivate_vmap=True)(rollout.clone())
    found = update.gae(update._with_values(rollout.clone()))
    assert (done & ~step["terminated"]).any()
    torch.testing.assert_close(found["advantage"], expected["advantage"])
    torch.testing.assert_close(found["value_target"], expected["value_target"])
