"""Acting with latents: the transform that plays them, and the policy that does the same step by step."""

import pytest
import torch
from spirl_agent import DECODERS, make_agent
from tensordict import TensorDict
from torch.testing import assert_close
from torchrl.envs import Compose, ExplorationType, StepCounter, TransformedEnv, set_exploration_type
from transform_parts import Slot

from tstar_rl.rollouts.collection import with_starts
from tstar_rl.rollouts.episodes import run_episodes
from tstar_rl.spirl import LatentExecution, LatentPolicy
from tstar_rl.transforms import EpisodeStart, GAILReward, ProximityReward, RewardMixture, TerminalStateReward

BEHIND = [
    lambda: ProximityReward(Slot()),
    lambda: GAILReward(Slot()),
    lambda: TerminalStateReward(Slot(), score="before"),
]
"""Rewards that depend on the state in which a step began."""


def forward_by(latent, observation, step):
    """A decoder of latents of one number z: action 0 is z, but -z / 2 at the second step."""
    action = torch.zeros(*step.shape, 9)
    action[..., 0] = torch.where(step == 1, -0.5, 1.0) * latent[..., 0]
    return action


def latent_policy(value):
    return lambda tensordict: tensordict.set("latent", torch.full((*tensordict.batch_size, 1), value))


class TestLatentExecution:
    """`PointEnv`: action 0 moves by half of it and is the reward; past 1 is a success and pays 10 more."""

    def test_rewards_are_summed_over_a_latent(self, make_env):
        env = TransformedEnv(make_env(seed=3), LatentExecution(forward_by, 1, 4))
        step = env.step(latent_policy(0.4)(env.reset()))
        # 0.4 - 0.2 + 0.4 + 0.4 = 1.0 of reward, 0.5 of way from less than 0.2: no end yet
        assert_close(step["next", "reward_env"], torch.full((3, 1), 1.0))
        assert (step["next", "latent_steps"] == 4).all() and not step["next", "done"].any()
        assert (step["next", "observation"][:, 1] == 4).all()

    def test_an_end_on_the_way_is_what_is_returned(self, make_env):
        env = TransformedEnv(make_env(), Compose(StepCounter(), LatentExecution(forward_by, 1, 4)))
        env.base_env._reset = _from(env.base_env._reset, torch.tensor([-0.2, 0.7, 0.9]))
        step = env.step(latent_policy(0.8)(env.reset()))
        following = step["next"]
        # Positions: -.2 -> .2 0 .4 .8, no end; .7 -> 1.1, past 1 in one step; .9 -> 1.3, likewise.
        assert following["latent_steps"].squeeze(-1).tolist() == [4, 1, 1]
        assert following["done"].squeeze(-1).tolist() == [False, True, True]
        assert_close(following["observation"][:, 0], torch.tensor([0.8, 1.1, 1.3]))
        assert_close(following["reward_env"].squeeze(-1), torch.tensor([2.0, 10.8, 10.8]))
        assert following["step_count"].squeeze(-1).tolist() == [4, 1, 1]

    def test_a_simulation_that_a_step_leaves_out_takes_none(self, make_env):
        env = TransformedEnv(make_env(seed=3), LatentExecution(forward_by, 1, 4))
        inner, seen = env.base_env._step, []
        env.base_env._step = lambda tensordict: seen.append(tensordict["_step"].tolist()) or inner(tensordict)
        asked = [True, False, True]
        begun = latent_policy(0.4)(env.reset()).set("_step", torch.tensor(asked))
        assert env.step(begun)["next", "latent_steps"].squeeze(-1).tolist() == [4, 0, 4]
        assert seen == [asked] * 4

    def test_rows_that_ended_begin_anew_while_others_go_on(self, make_env):
        env = TransformedEnv(
            make_env(max_steps=6), Compose(StepCounter(), EpisodeStart(), LatentExecution(forward_by, 1, 4))
        )
        rollout = env.rollout(4, latent_policy(0.0), break_when_any_done=False)
        # Episodes of six steps: a latent takes four, the next one two, cut short by the truncation.
        assert rollout["next", "latent_steps"][0].squeeze(-1).tolist() == [4, 2, 4, 2]
        assert rollout["next", "truncated"][0].squeeze(-1).tolist() == [False, True, False, True]
        assert_close(rollout["start_observation"][..., 0], rollout["next", "observation"][..., 0])

    def test_mixture_before_and_after_agree(self, make_env):
        for first in (True, False):
            both = [RewardMixture({"env": 1.0}, reward_scale=0.1), LatentExecution(forward_by, 1, 4)]
            env = TransformedEnv(make_env(), Compose(*(both if first else both[::-1])))
            after = env.rollout(6, latent_policy(0.8), break_when_any_done=False)["next"]
            assert_close(after["reward"], 0.1 * after["reward_env"])

    @pytest.mark.parametrize("make", BEHIND)
    def test_a_reward_behind_it_is_of_the_whole_latent(self, make, make_env):
        """In the environment as outside: from where the latent began to where it ended."""
        env = TransformedEnv(make_env(), Compose(StepCounter(), LatentExecution(forward_by, 1, 3), make()))
        rollout = env.rollout(6, latent_policy(0.5), break_when_any_done=False)
        inside, outside = (steps["next", make().out_keys[0]] for steps in (rollout, make()(rollout.clone())))
        assert_close(inside, outside)
        assert len(inside.unique()) > 1 and not {"_begun", "_outcome"} & set(rollout.keys())

    @pytest.mark.parametrize("decoder", DECODERS)
    def test_step_by_step_the_policy_does_the_same(self, decoder, make_env):
        agent = make_agent(decoder)
        with set_exploration_type(ExplorationType.DETERMINISTIC), torch.no_grad():
            alone = run_episodes(with_starts(make_env(max_steps=10)), agent.policy)
            env = with_starts(make_env(max_steps=10))
            env.append_transform(LatentExecution(agent.model.decoder, 3, 4))
            played = run_episodes(env, agent.actor)
        for key in ("observation", "done", "step_count"):
            assert_close(played["next", key], alone["next", key])

    def test_no_step_at_all_is_refused(self):
        with pytest.raises(ValueError, match="at least 1, got 0"):
            LatentExecution(forward_by, 1, 0)


def _from(reset, positions):
    """A reset of `PointEnv` to these positions."""

    def to_positions(tensordict=None, **kwargs):
        out = reset(tensordict, **kwargs)
        env = reset.__self__
        env.physics[:, 0] = positions.double()
        return out.set("observation", torch.cat([positions.unsqueeze(-1), torch.zeros(3, 71)], -1))

    return to_positions


def test_the_policy_keeps_a_latent_for_a_horizon():
    chosen = iter(range(1, 100))
    policy = LatentPolicy(
        lambda td: td.set("latent", torch.full((*td.batch_size, 1), float(next(chosen)))),
        forward_by,
        3,
    )
    latents = []
    tensordict = TensorDict({"observation": torch.zeros(2, 72)}, [2])
    for count in ([0, 1], [1, 2], [2, 3], [3, 4]):
        tensordict["step_count"] = torch.tensor(count).unsqueeze(-1)
        latents.append(policy(tensordict)["latent"].squeeze(-1).tolist())
    assert latents == [[1, 1], [1, 1], [1, 3], [4, 3]]
