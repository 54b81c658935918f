"""One contract that every transform meets."""

import pytest
from tensordict.nn import TensorDictModule
from torch import nn
from torch.testing import assert_close
from torchrl.collectors import Collector
from torchrl.data import LazyTensorStorage, SamplerWithoutReplacement, TensorDictReplayBuffer
from torchrl.envs import Compose, SerialEnv, StepCounter, Transform, TransformedEnv
from torchrl.envs.utils import check_env_specs
from transform_parts import FixedStarts, Slot

from tstar_rl import transforms
from tstar_rl.rollouts.starts import MixedStarts
from tstar_rl.spirl import LatentExecution
from tstar_rl.transforms import (
    EpisodeStart,
    FeasibilityReward,
    GAILReward,
    HandOverValueReward,
    ProximityReward,
    RewardMixture,
    SkillChainReset,
    TerminalStateReward,
)


def repeat(latent, observation, step):
    """A decoder: the latent is the action, at every step."""
    return latent


# name: (how to make it, what it writes below "next", whether loose steps will do)
TRANSFORMS = {
    "GAILReward": (lambda: GAILReward(Slot()), "reward_gail", True),
    "TerminalStateReward": (lambda: TerminalStateReward(Slot()), "reward_tsr", True),
    "TerminalStateReward before": (lambda: TerminalStateReward(Slot(), score="before"), "reward_tsr", True),
    "FeasibilityReward": (lambda: FeasibilityReward(Slot()), "reward_tsr", True),
    "HandOverValueReward": (lambda: HandOverValueReward(Slot(), Slot(1), 0.01, 2.0), "reward_tsr", True),
    "ProximityReward": (lambda: ProximityReward(Slot()), "reward_proximity", True),
    "RewardMixture": (lambda: RewardMixture({"env": 0.5}), "reward", True),
    "EpisodeStart": (EpisodeStart, "start_observation", False),
    "SkillChainReset": (lambda: SkillChainReset(FixedStarts()), "start_chained", False),
    "SkillChainReset mixed": (
        lambda: SkillChainReset(MixedStarts([FixedStarts()] * 2, [1, 7])),
        "start_chained",
        False,
    ),
    "LatentExecution": (lambda: LatentExecution(repeat, 9, 2, latent_key="action"), "latent_steps", False),
}
contract = pytest.mark.parametrize("name", TRANSFORMS)


def test_the_contract_is_that_of_every_transform():
    ours = {name for name in transforms.__all__ if isinstance(getattr(transforms, name), type)}
    ours = {name for name in ours if issubclass(getattr(transforms, name), Transform)}
    assert ours - {"RewardTransform"} | {"LatentExecution"} == {name.split()[0] for name in TRANSFORMS}


@contract
class TestContract:
    """Where TorchRL may put a transform: in an env (batched, serial), composed, before a model, in a buffer."""

    def test_specs_of_an_env(self, name, make_env):
        make, _, _ = TRANSFORMS[name]
        check_env_specs(TransformedEnv(make_env(), make()))
        check_env_specs(TransformedEnv(make_env(), Compose(StepCounter(), make())))

    def test_batched_rollout(self, name, make_env, policy):
        make, key, _ = TRANSFORMS[name]
        rollout = TransformedEnv(make_env(), make()).rollout(6, policy, break_when_any_done=False)
        assert rollout.batch_size == (3, 6)
        if key:
            assert rollout["next", key].shape[:2] == (3, 6)

    def test_serial_env_equals_one_by_one(self, name, make_env, policy):
        make, key, _ = TRANSFORMS[name]
        inside = SerialEnv(
            2,
            [
                lambda: TransformedEnv(make_env(seed=1), make()),
                lambda: TransformedEnv(make_env(seed=2), make()),
            ],
        )
        serial = inside.rollout(6, policy, break_when_any_done=False)
        alone = TransformedEnv(make_env(seed=2), make()).rollout(6, policy, break_when_any_done=False)
        assert_close(serial["next", "observation"][1], alone["next", "observation"])
        if key:
            assert_close(serial["next", key][1], alone["next", key])

    def test_around_a_serial_env(self, name, make_env, policy):
        make, key, _ = TRANSFORMS[name]
        env = TransformedEnv(SerialEnv(2, make_env), make())
        rollout = env.rollout(6, policy, break_when_any_done=False)
        assert rollout.batch_size == (2, 3, 6)
        if key:
            assert rollout["next", key].shape[:3] == (2, 3, 6)

    def test_collector(self, name, make_env, policy):
        make, key, _ = TRANSFORMS[name]
        env = TransformedEnv(make_env(), make())
        collector = Collector(
            env, policy, frames_per_batch=12, total_frames=24, auto_register_policy_transforms=False
        )
        batches = list(collector)
        assert [batch.batch_size for batch in batches] == [(3, 4), (3, 4)]
        assert key is None or all(("next", key) in batch.keys(True) for batch in batches)

    def test_elsewhere_equals_in_the_env_or_raises(self, name, make_env, policy):
        make, key, loose = TRANSFORMS[name]
        inside = TransformedEnv(make_env(), make()).rollout(6, policy, break_when_any_done=False)
        bare = make_env().rollout(6, policy, break_when_any_done=False)
        buffer = TensorDictReplayBuffer(
            storage=LazyTensorStorage(18),
            sampler=SamplerWithoutReplacement(),
            batch_size=18,
            transform=make(),
        )
        buffer.extend(bare.reshape(-1))
        before_a_model = nn.Sequential(make(), TensorDictModule(nn.Identity(), ["observation"], ["copy"]))
        if not loose:
            for use in (make(), before_a_model, Compose(make())):
                with pytest.raises(NotImplementedError, match="append it to an environment"):
                    use(bare.clone())
            with pytest.raises(NotImplementedError, match="append it to an environment"):
                buffer.sample()
            return
        for use in (make(), before_a_model, Compose(make())):
            assert_close(use(bare.clone())["next", key], inside["next", key])
        sample = buffer.sample()
        assert sorted(sample["index"].tolist()) == list(range(18))
        assert_close(sample["next", key], inside["next", key].reshape(18, 1)[sample["index"]])
        with pytest.raises(KeyError, match="needs steps"):
            make()(bare["next"].clone())
