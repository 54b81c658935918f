"""One contract that every transform meets, then what each of them does."""

import pytest
import torch
from tensordict import TensorDict
from tensordict.nn import TensorDictModule
from torch import nn
from torch.testing import assert_close
from torchrl.collectors import Collector
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer
from torchrl.envs import Compose, SerialEnv, StepCounter, TransformedEnv
from torchrl.envs.utils import check_env_specs

from tstar_rl.starts import MixedStarts
from tstar_rl.transforms import (
    ConstantBonus,
    EpisodeStart,
    GAILReward,
    RewardMixture,
    SkillChainReset,
    SkillExecution,
    TerminalStateReward,
)


class Slot(nn.Module):
    """Scores an observation by one of its numbers."""

    def __init__(self, index: int = 0) -> None:
        super().__init__()
        self.index = index

    def forward(self, obs):
        return obs[..., self.index : self.index + 1]


class FixedStarts:
    """Starts at a position of 0.9."""

    def __init__(self, available: bool = True) -> None:
        self.available = available

    def sample(self, n, generator):
        n = n if self.available else 0
        physics = torch.zeros(n, 4, dtype=torch.float64)
        physics[:, 0] = 0.9
        task = TensorDict({"steps": torch.zeros(n, dtype=torch.int64)}, [n])
        welds = torch.zeros(n, 2, 11, dtype=torch.float64)
        return TensorDict({"physics": physics, "welds": welds, "task": task}, [n])


def repeat(skill, observation, step):
    """A decoder: the skill is its action, every time."""
    return skill


# name: (how to make it, what it writes below "next", whether loose steps will do)
TRANSFORMS = {
    "GAILReward": (lambda: GAILReward(Slot()), "reward_gail", True),
    "GAILReward next": (lambda: GAILReward(Slot(), state="next"), "reward_gail", True),
    "TerminalStateReward": (lambda: TerminalStateReward(Slot()), "reward_tsr", True),
    "TerminalStateReward before": (lambda: TerminalStateReward(Slot(), score="before"), "reward_tsr", True),
    "RewardMixture": (lambda: RewardMixture(lambda_2=0.0), "reward", True),
    "EpisodeStart": (EpisodeStart, "start_observation", False),
    "SkillChainReset": (lambda: SkillChainReset(FixedStarts()), None, False),
    "SkillChainReset mixed": (lambda: SkillChainReset(MixedStarts([FixedStarts()] * 2, [1, 7])), None, False),
    "SkillExecution": (lambda: SkillExecution(repeat, 9, 2, skill_key="action"), "skill_steps", False),
}
contract = pytest.mark.parametrize("name", TRANSFORMS)


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
        buffer = TensorDictReplayBuffer(storage=LazyTensorStorage(18), batch_size=18, transform=make())
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
        assert_close(buffer.sample()["next", key].shape, torch.Size([18, 1]))
        with pytest.raises(KeyError, match="needs steps"):
            make()(bare["next"].clone())


def steps(observation, following, success=(False, False), **rewards):
    """Two steps: observations of one number each."""

    def column(values):
        return torch.tensor(values).unsqueeze(-1)

    after = {"observation": column(following), "success": column(success)}
    after.update({name: column(values) for name, values in rewards.items()})
    return TensorDict({"observation": column(observation), "next": TensorDict(after, [2])}, [2])


def test_gail_reward_of_either_state():
    batch = steps([0.0, 1.0], [3.0, 2.0])
    assert_close(GAILReward(Slot())(batch)["next", "reward_gail"], torch.tensor([[0.75], [1.0]]))
    assert_close(GAILReward(Slot(), "next")(batch)["next", "reward_gail"], torch.tensor([[0.0], [0.75]]))


def test_terminal_state_reward_is_paid_on_success_alone():
    batch = steps([0.1, 0.2], [0.6, 0.7], success=(False, True))
    assert_close(TerminalStateReward(Slot())(batch)["next", "reward_tsr"], torch.tensor([[0.0], [0.7]]))
    before = TerminalStateReward(Slot(), score="before")(batch)
    assert_close(before["next", "reward_tsr"], torch.tensor([[0.0], [0.2]]))
    constant = TerminalStateReward(ConstantBonus(0.45))(batch)
    assert_close(constant["next", "reward_tsr"], torch.tensor([[0.0], [0.45]]))


def test_running_mean_is_subtracted_and_saved():
    transform = TerminalStateReward(Slot(), baseline="running_mean", momentum=0.5)
    # The first two successes set the mean to 0.4; the next, of 0.8, moves it half way to 0.6 and is paid 0.2.
    first = transform(steps([0.0, 0.0], [0.2, 0.6], success=(True, True)))
    assert_close(first["next", "reward_tsr"], torch.tensor([[-0.2], [0.2]]))
    second = steps([0.0, 0.0], [0.8, 0.9], success=(True, False))
    copy = TerminalStateReward(Slot(), baseline="running_mean", momentum=0.5)
    copy.load_state_dict(transform.state_dict())
    for each in (transform, copy):
        assert_close(each(second.clone())["next", "reward_tsr"], torch.tensor([[0.2], [0.0]]))


def test_mixture_sums_once_and_prints_its_weights():
    mixture = RewardMixture(0.5, 0.25, 100.0, reward_scale=0.1, gail_scale=2.0)
    assert mixture.effective_weights() == pytest.approx(
        {"reward_env": 0.05, "reward_gail": 0.05, "reward_tsr": 10.0}
    )
    assert repr(mixture) == "RewardMixture(reward = 0.05 reward_env + 0.05 reward_gail + 10 reward_tsr)"
    batch = steps(
        [0.0, 0.0], [0.0, 0.0], reward_env=[4.0, 0.0], reward_gail=[1.0, 1.0], reward_tsr=[0.0, 0.5]
    )
    assert_close(mixture(batch)["next", "reward"], torch.tensor([[0.25], [5.05]]))


def test_mixture_reads_only_what_counts():
    batch = steps([0.0, 0.0], [0.0, 0.0], reward_env=[4.0, 2.0])
    assert_close(RewardMixture(0.5, 0.0)(batch.clone())["next", "reward"], torch.tensor([[0.1], [0.05]]))
    with pytest.raises(
        KeyError, match="RewardMixture needs 'reward_gail'; got only observation, reward_env, success"
    ):
        RewardMixture(0.5, 0.5)(batch)


def test_the_whole_stack_in_an_env(make_env, policy):
    stack = Compose(
        EpisodeStart(),
        GAILReward(Slot()),
        TerminalStateReward(Slot()),
        RewardMixture(0.5, 0.5, 10.0, reward_scale=1.0),
    )
    rollout = TransformedEnv(make_env(), stack).rollout(6, policy, break_when_any_done=False)
    after = rollout["next"]
    expected = 0.5 * after["reward_env"] + 0.5 * after["reward_gail"] + 10.0 * after["reward_tsr"]
    assert_close(after["reward"], expected)
    assert (after["reward_tsr"][after["success"]] == 1).all() and after["success"].any()


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


def test_without_starts_the_environment_begins(make_env):
    starts = FixedStarts(available=False)
    env = TransformedEnv(make_env(), SkillChainReset(starts, probability=1.0))
    assert (env.reset()["observation"][:, 0] < 0.2).all() and env.transform.draws["environment"] == 3
    starts.available = True  # the set has grown: it is read by handle
    assert_close(env.reset()["observation"][:, 0], torch.full((3,), 0.9))


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


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: GAILReward(Slot(), state="last"), "'current' or 'next', got 'last'"),
        (lambda: TerminalStateReward(Slot(), score="mean"), "'terminal' or 'before', got 'mean'"),
        (lambda: TerminalStateReward(Slot(), baseline="mean"), "'none' or 'running_mean', got 'mean'"),
        (lambda: TerminalStateReward(Slot(), momentum=0.0), r"\(0, 1\], got 0.0"),
        (lambda: ConstantBonus(2.0), r"\[0, 1\].*got 2.0"),
        (lambda: RewardMixture(0.0, 0.0), "nothing to learn from"),
        (lambda: RewardMixture(float("nan")), "must be finite"),
        (lambda: SkillChainReset(FixedStarts(), probability=1.5), r"\[0, 1\], got 1.5"),
    ],
)
def test_mistakes_are_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()
