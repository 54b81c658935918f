"""A reward of a user's own that would ruin a policy is refused by name, in an environment and as a postproc."""

import pytest
import torch
from tensordict import TensorDict
from torchrl.envs import TransformedEnv
from torchrl.envs.utils import check_env_specs

from tstar_rl.checks import InvalidValueError
from tstar_rl.transforms import TerminalStateReward
from tstar_rl.transforms.reward_transform import RewardTransform


class Given(RewardTransform):
    """Gives what it was made with."""

    def __init__(self, said: torch.Tensor) -> None:
        super().__init__("reward_mine")
        self.said = said

    def reward(self, current, following):
        return self.said


MISTAKES = [
    (3.0, r"Given.reward must return a tensor of shape \(2, 3, 1\), got float"),
    (None, r"Given.reward must return a tensor of shape \(2, 3, 1\), got NoneType"),
    (torch.zeros(2, 3), r"Given must give reward_mine of shape \(2, 3, 1\), got \(2, 3\)"),
    (
        torch.tensor([0.0, float("nan"), 1.0]).expand(2, 3).unsqueeze(-1),
        "finite numbers, got 2 of 6 in reward_mine",
    ),
    (torch.full((2, 3, 1), float("inf")), "finite numbers, got 6 of 6 in reward_mine"),
]


@pytest.mark.parametrize(("said", "message"), MISTAKES)
def test_a_reward_of_another_shape_or_without_a_number_is_refused(said, message):
    steps = TensorDict({"next": TensorDict({"observation": torch.zeros(2, 3, 4)}, [2, 3])}, [2, 3])
    with pytest.raises(InvalidValueError, match=message):
        Given(said)(steps)
    assert Given(torch.ones(2, 3, 1))(steps)["next", "reward_mine"].sum() == 6


def test_a_reward_that_does_not_say_what_it_is_is_told_so():
    steps = TensorDict({"next": TensorDict({}, [2])}, [2])
    with pytest.raises(
        NotImplementedError, match=r"RewardTransform must define reward\(current, following\)"
    ):
        RewardTransform("reward_mine")(steps)


@pytest.mark.parametrize("successes", [1, 3])
def test_what_is_said_of_states_has_one_number_for_each(successes):
    class Mine(TerminalStateReward):
        def said(self, obs):
            return obs[..., 0]

    success = (torch.arange(3) < successes).unsqueeze(-1)
    reached = TensorDict({"observation": torch.ones(3, 4), "success": success}, [3])
    with pytest.raises(
        InvalidValueError, match=rf"Mine.said .*\({successes}, 1\) of .*; got \({successes},\)"
    ):
        Mine(torch.nn.Identity())(TensorDict({"observation": torch.ones(3, 4), "next": reached}, [3]))


@pytest.mark.parametrize("said", [torch.ones(2, 1, dtype=torch.float64), torch.ones(2, 1, dtype=torch.bool)])
def test_a_reward_of_another_type_has_that_of_its_spec(said, make_env):
    check_env_specs(TransformedEnv(make_env(num_envs=2), Given(said)))


def test_an_environment_refuses_it_at_the_step(make_env, policy):
    env = TransformedEnv(make_env(num_envs=2), Given(torch.full((2, 1), float("nan"))))
    with pytest.raises(InvalidValueError, match="got 2 of 2 in reward_mine"):
        env.rollout(2, policy)
