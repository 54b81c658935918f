"""Where a transform of resets cannot act, it says so before any row is wrong."""

import pytest
import torch
from torch.testing import assert_close
from torchrl.envs import Compose, ParallelEnv, RenameTransform, SerialEnv, StepCounter, TransformedEnv
from transform_parts import FixedStarts

from tstar_rl.checks import InvalidValueError
from tstar_rl.rollouts.starts import MixedStarts
from tstar_rl.transforms import EpisodeStart, SkillChainReset


def test_around_workers_that_would_drop_the_starts_it_is_refused(make_env):
    env = TransformedEnv(
        ParallelEnv(2, make_env, mp_start_method="fork", shutdown_timeout=1.0),
        SkillChainReset(FixedStarts(), probability=1.0),
    )
    with pytest.raises(InvalidValueError, match="append it to the environment that each worker makes"):
        env.reset()
    env.close()


def test_around_environments_with_transforms_of_their_own_it_is_refused(make_env):
    """TorchRL hands only declared entries on to these: the starts would be dropped, and the rows say otherwise."""
    counted = lambda: TransformedEnv(make_env(num_envs=2), StepCounter())  # noqa: E731
    for env in (SerialEnv(2, counted), TransformedEnv(counted(), auto_unwrap=False)):
        around = TransformedEnv(env, SkillChainReset(FixedStarts(), probability=1.0), auto_unwrap=False)
        with pytest.raises(InvalidValueError, match="does not act around a TransformedEnv"):
            around.reset()
    bare = TransformedEnv(SerialEnv(2, lambda: make_env(num_envs=2)), SkillChainReset(FixedStarts(), 1.0))
    assert_close(bare.reset()["observation"][..., 0], torch.full((2, 2), 0.9))


def test_two_of_them_are_refused_since_one_would_choose_and_the_other_tell(make_env):
    env = TransformedEnv(make_env(), SkillChainReset(FixedStarts(), probability=1.0))
    env.append_transform(SkillChainReset(FixedStarts(), probability=0.0))
    with pytest.raises(InvalidValueError, match=r"two SkillChainReset.*MixedStarts"):
        env.reset()
    mixed = MixedStarts([FixedStarts(), FixedStarts()], [1.0, 3.0])
    assert TransformedEnv(make_env(), SkillChainReset(mixed, 1.0)).reset()["start_chained"].all()


def test_a_step_without_a_reset_is_told_what_to_do(make_env):
    env = TransformedEnv(make_env(), SkillChainReset(FixedStarts(), 1.0))
    with pytest.raises(KeyError, match="no 'start_chained'; begin with env.reset"):
        env.step(make_env().rand_action())
    renamed = TransformedEnv(make_env(), Compose(RenameTransform(["observation"], ["seen"]), EpisodeStart()))
    with pytest.raises(KeyError, match="the environment has no 'observation'; it has .*seen"):
        renamed.reset()
