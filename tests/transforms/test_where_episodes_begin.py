"""Where episodes begin, and what each row says of it: `SkillChainReset` and `EpisodeStart`."""

import pytest
import torch
from torch.testing import assert_close
from torchrl.envs import Compose, TransformedEnv
from transform_parts import FixedStarts

from tstar_rl.checks import InvalidValueError
from tstar_rl.rollouts.starts import MixedStarts
from tstar_rl.transforms import (
    EpisodeStart,
    SkillChainReset,
)


def test_episode_start_reaches_the_last_row(make_env, policy):
    rollout = TransformedEnv(make_env(), EpisodeStart()).rollout(8, policy, break_when_any_done=False)
    start, position = rollout["next", "start_observation"][..., 0], rollout["next", "observation"][..., 0]
    steps_taken = rollout["next", "observation"][..., 1]
    assert_close(start + 0.4 * steps_taken, position)  # each row moved 0.4 a step from its own start
    assert rollout["next", "done"].sum() > 3  # through resets of some rows while others went on
    assert len(start[rollout["next", "success"].squeeze(-1)].unique()) > 3


def test_chained_starts_go_to_rows_being_reset(make_env, policy):
    env = TransformedEnv(make_env(num_envs=50), SkillChainReset(FixedStarts(), probability=0.8, seed=3))
    first = env.reset()["observation"][:, 0]
    chained = int(torch.isclose(first, torch.tensor(0.9)).sum())
    assert 30 <= chained <= 48 and (first[~torch.isclose(first, torch.tensor(0.9))] < 0.2).all()
    assert env.transform.draws == {"chained": chained, "environment": 50 - chained}
    rollout = env.rollout(6, policy, break_when_any_done=False)
    assert sum(env.transform.draws.values()) == 100 + int(rollout["next", "done"][:, :-1].sum())


class Numbered(FixedStarts):
    """Draws that can be told apart."""

    def sample(self, n, generator):
        drawn = super().sample(n, generator)
        drawn["physics"][:, 0] = torch.arange(n).double()
        return drawn


def test_each_chained_row_has_a_draw_of_its_own():
    start = SkillChainReset(Numbered(), 0.5, seed=3)._draw(torch.ones(50, dtype=torch.bool))
    assert start is not None and 10 < start["use"].sum() < 40
    used = start["use"].squeeze(-1)
    assert start["snapshot", "physics"][used, 0].tolist() == list(range(int(used.sum())))


def test_without_starts_the_environment_begins(make_env):
    starts = FixedStarts(available=False)
    env = TransformedEnv(make_env(), SkillChainReset(starts, probability=1.0))
    assert (env.reset()["observation"][:, 0] < 0.2).all() and env.transform.draws["environment"] == 3
    starts.available = True  # the set has grown: it is read by handle
    assert_close(env.reset()["observation"][:, 0], torch.full((3,), 0.9))


def test_a_source_that_gives_too_few_or_too_many_is_refused_by_its_name(make_env):
    class Two(FixedStarts):
        def sample(self, n, generator):
            return super().sample(2, generator)

    for starts in (Two(), MixedStarts([Two(), FixedStarts()], [1.0, 1e-9])):
        env = TransformedEnv(make_env(), SkillChainReset(starts, probability=1.0))
        with pytest.raises(
            InvalidValueError, match=r"Two\.sample\(3\) gave 2 starts: it must give as many as"
        ):
            env.reset()
        assert env.transform.draws == {"environment": 0, "chained": 0}


def test_draws_resume_from_the_state_dict():
    transform, other = (
        SkillChainReset(FixedStarts(), 0.5, seed=1),
        SkillChainReset(FixedStarts(), 0.5, seed=2),
    )
    rows = torch.ones(40, dtype=torch.bool)
    transform._draw(rows)
    other.load_state_dict(transform.state_dict())
    assert other.draws == transform.draws
    assert_close(other._draw(rows)["use"], transform._draw(rows)["use"])


def test_every_row_says_whether_its_episode_began_in_a_chained_start(make_env, policy):
    """Also where others begin anew meanwhile, some of them from the environment's own starts."""
    both = Compose(EpisodeStart(), SkillChainReset(FixedStarts(), 0.5, seed=3))
    rollout = TransformedEnv(make_env(num_envs=20), both).rollout(8, policy, break_when_any_done=False)
    began = torch.isclose(rollout["start_observation"][..., :1], torch.tensor(0.9))
    done = rollout["next", "done"]
    assert (done.any(0) & ~done.all(0)).any() and 0 < began.sum() < began.numel()
    assert torch.equal(rollout["start_chained"], began) and torch.equal(
        rollout["next", "start_chained"], began
    )
