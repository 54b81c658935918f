"""State sets grow from successes, sample from their generator, and survive saving."""

from multiprocessing.reduction import ForkingPickler

import pytest
import torch
from tensordict import TensorDict, assert_close
from torchrl.envs import TransformedEnv

from tstar_rl.checks import InvalidValueError
from tstar_rl.rollouts.state_sets import InitiationSet, StateSet, TerminationSet
from tstar_rl.rollouts.terminal_gaussian import TerminalGaussian
from tstar_rl.transforms import EpisodeStart, SkillChainReset


def seeded(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def rows(*values: float) -> TensorDict:
    return TensorDict({"observation": torch.tensor(values).unsqueeze(-1)}, [len(values)])


@pytest.fixture
def rollout(make_env, policy):
    return TransformedEnv(make_env(), EpisodeStart()).rollout(8, policy, break_when_any_done=False)


def termination_set(positions: torch.Tensor) -> TerminationSet:
    """Of two numbers a state, the first the position; the n-th was reached after n steps."""
    n = len(positions)
    physics = torch.zeros(n, 4, dtype=torch.float64)
    physics[:, :2] = positions
    task = TensorDict({"steps": torch.arange(n)}, [n])
    snapshot = TensorDict(
        {"physics": physics, "welds": torch.zeros(n, 2, 11, dtype=torch.float64), "task": task}, [n]
    )
    states = TerminationSet(1000)
    states.extend(TensorDict({"observation": torch.zeros(n, 72), "snapshot": snapshot}, [n]))
    return states


def test_the_ring_keeps_the_newest():
    states = StateSet(capacity=3)
    assert states.extend(rows(1, 2)) == 2 and states.extend(rows(3, 4)) == 2
    assert len(states) == 3
    assert sorted(states.all()["observation"].flatten().tolist()) == [2, 3, 4]
    states.extend(rows(5, 6, 7, 8))
    assert sorted(states.all()["observation"].flatten().tolist()) == [6, 7, 8]


def test_states_of_other_entries_are_refused():
    """TorchRL's storage would fill what they lack with whatever lay in memory."""
    states = StateSet(4)
    states.extend(TensorDict({"observation": torch.ones(1, 1), "snapshot": {"steps": torch.ones(1)}}, [1]))
    with pytest.raises(
        InvalidValueError, match=r"must have the entries .*these lack \('snapshot', 'steps'\)"
    ):
        states.extend(rows(1))
    whole = states.all()
    with pytest.raises(InvalidValueError, match="these have mine"):
        states.extend(whole.clone().set("mine", torch.ones(1)))
    wide = whole.clone().set("observation", torch.ones(1, 4))
    for those, others in ((whole, wide), (wide, whole)):
        there = StateSet(4)
        there.extend(those)
        with pytest.raises(InvalidValueError, match=r"sizes of those in the set, observation \([14],\); got"):
            there.extend(others)
    assert len(states) == 1
    states.extend(whole)


def test_sampling_follows_the_generator():
    states = StateSet(10)
    states.extend(rows(*range(10)))
    assert_close(states.sample(20, seeded()), states.sample(20, seeded()))
    assert states.sample(20, seeded()).batch_size == (20,)
    drawn = states.sample(1000, seeded())["observation"]
    assert set(drawn.flatten().tolist()) == set(range(10))
    assert StateSet(10).sample(5, seeded()).batch_size == (0,)


def test_a_termination_set_is_drawn_by_its_weights_until_it_changes():
    states = termination_set(torch.tensor([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]))

    def drawn() -> list[int]:
        found = states.sample(4000, seeded())["snapshot", "physics"][:, 0]
        return [int((found == position).sum()) for position in (0.0, 1.0, 2.0)]

    states.weigh(torch.tensor([0.0, 1.0, 3.0]))
    none, some, most = drawn()
    assert none == 0 and 900 < some < 1100 and some + most == 4000  # 1000, with a deviation of 27
    states.extend(states.all()[:1])
    first, second, third = drawn()  # the first of three is there twice
    assert 1850 < first < 2150 and 850 < second < 1150 and first + second + third == 4000


@pytest.mark.parametrize(
    "weights", [[1.0], [1.0, -1.0, 1.0], [0.0, 0.0, 0.0], [1.0, 1.0, torch.inf], [1.0, torch.nan, 1.0]]
)
def test_weights_that_are_none_are_refused(weights):
    states = termination_set(torch.zeros(3, 2))
    with pytest.raises(ValueError, match="a set of 3 states needs as many weights"):
        states.weigh(torch.tensor(weights))


def test_sets_grow_from_the_successes_of_a_rollout(rollout):
    success = rollout["next", "success"].squeeze(-1)
    initiation, termination = InitiationSet(100), TerminationSet(100)
    count = int(success.sum())
    assert count > 0 and initiation.extend_from(rollout) == count == termination.extend_from(rollout)
    s_0, s_T = initiation.all()["observation"], termination.all()
    assert (s_0[:, 0] < 0.2).all() and (s_0[:, 1] == 0).all()
    assert (s_T["observation"][:, 0] > 1).all()
    torch.testing.assert_close(s_T["snapshot", "physics"][:, 0].float(), s_T["observation"][:, 0])
    failures = rollout[~success]
    assert initiation.extend_from(failures) == 0 and len(initiation) == count


def test_a_rollout_without_what_a_set_needs_is_named(make_env, policy):
    bare = make_env(snapshots=False).rollout(3, policy, break_when_any_done=False)
    with pytest.raises(KeyError, match="has no start_observation; it has action, "):
        InitiationSet().extend_from(bare)
    with pytest.raises(KeyError, match=r"has no next\.snapshot; "):
        TerminationSet().extend_from(bare)


def test_a_loaded_set_goes_on_like_the_first(rollout):
    first, second = TerminationSet(5), TerminationSet(5)
    first.extend_from(rollout)
    first.extend_from(rollout[:1])
    state = first.state_dict()
    first.extend_from(rollout[1:2])  # what was taken must not change with the set
    second.load_state_dict(state)
    second.extend_from(rollout[1:2])
    for states in (first, second):
        states.extend_from(rollout[2:])
    assert_close(first.all(), second.all())
    assert_close(first.sample(9, seeded()), second.sample(9, seeded()))


@pytest.mark.parametrize("capacity", [3, 5])
def test_a_ring_of_another_capacity_goes_on_from_its_oldest_state(capacity):
    ring, loaded = StateSet(3), StateSet(capacity)
    for value in range(5):
        ring.extend(rows(value))  # the slots hold 3, 4, 2
    loaded.load_state_dict(ring.state_dict())
    seen = []
    for value in range(10, 14):
        loaded.extend(rows(value))
        seen.append(sorted(loaded.observations().flatten().tolist()))
    newest = [2, 3, 4, 10, 11, 12, 13]
    assert seen == [newest[:end][-capacity:] for end in range(4, 8)]


def test_a_set_that_a_larger_one_was_loaded_into_keeps_the_newest():
    large, loaded = StateSet(5), StateSet(3)
    large.extend(rows(1, 2, 3))
    loaded.load_state_dict(large.state_dict())
    loaded.extend(rows(4))
    assert sorted(loaded.observations().flatten().tolist()) == [2, 3, 4]


def test_an_empty_set_survives_loading():
    states = StateSet(5)
    states.extend(rows(1))
    states.load_state_dict(StateSet(5).state_dict())
    assert len(states) == 0


def test_loading_mistakes_are_named():
    big = StateSet(4)
    big.extend(rows(1, 2, 3))
    with pytest.raises(ValueError, match="has 3 states, but this one's capacity is 2"):
        StateSet(2).load_state_dict(big.state_dict())
    with pytest.raises(ValueError, match="at least 1, got 0"):
        StateSet(0)


def test_gaussian_has_the_sets_moments(make_env):
    # Two numbers that move together: mean (0.5, -1), variances 0.01 and 0.04, correlation 1.
    noise = torch.randn(900, 1, generator=seeded(), dtype=torch.float64)
    states = termination_set(torch.tensor([[0.5, -1.0]]) + noise * torch.tensor([[0.1, 0.2]]))
    gaussian = TerminalGaussian(make_env(), states)
    drawn = gaussian.sample(4000, seeded(1))["physics"][:, :2]
    torch.testing.assert_close(drawn.mean(0), torch.tensor([0.5, -1.0]).double(), atol=0.02, rtol=0)
    covariance = torch.tensor([[0.01, 0.02], [0.02, 0.04]]).double()
    torch.testing.assert_close(drawn.T.cov(), covariance, atol=0.004, rtol=0)
    assert gaussian.counts == {"drawn": 4000, "refused": 0, "given_up": 0}
    assert_close(gaussian.sample(3, seeded(2)), gaussian.sample(3, seeded(2)))


def test_what_is_no_position_comes_from_any_member_of_the_set(make_env):
    states = termination_set(torch.randn(9, 2, generator=seeded(), dtype=torch.float64) * 0.1)
    drawn = TerminalGaussian(make_env(), states).sample(50, seeded())
    assert len(drawn["task", "steps"].unique()) > 3


def test_refused_draws_are_drawn_again_and_counted(make_env):
    # The environment refuses positions from 1.5 on: half of the draws around 1.5.
    noise = torch.randn(900, 2, generator=seeded(), dtype=torch.float64)
    states = termination_set(torch.tensor([[1.5, 0.0]]) + 0.1 * noise)
    gaussian = TerminalGaussian(make_env(), states, tries=30)
    drawn = gaussian.sample(400, seeded(1))
    assert drawn.batch_size == (400,) and (drawn["physics"][:, 0] < 1.5).all()
    assert gaussian.counts["given_up"] == 0 and 250 < gaussian.counts["refused"] < 600
    assert gaussian.counts["drawn"] == 400 + gaussian.counts["refused"]
    hopeless = TerminalGaussian(make_env(), termination_set(torch.full((3, 2), 9.0)), tries=2)
    assert (hopeless.sample(4, seeded())["physics"][:, 0] == 9).all()  # members of the set stand in
    assert hopeless.counts == {"drawn": 8, "refused": 8, "given_up": 4}


def test_gaussian_follows_its_set_and_is_empty_with_it(make_env):
    states = TerminationSet(100)
    gaussian = TerminalGaussian(make_env(), states)
    assert gaussian.sample(3, seeded()).batch_size == (0,)
    states.extend(termination_set(torch.zeros(5, 2)).all())
    assert (gaussian.sample(3, seeded())["physics"] == 0).all()
    states.extend(termination_set(torch.ones(5, 2)).all())
    assert gaussian.sample(3, seeded())["physics"].any()


@pytest.mark.parametrize("kind", ["set", "gaussian"])
def test_sets_serve_as_starts_of_the_next_skill(kind, make_env):
    states = termination_set(torch.full((4, 2), 0.7))
    starts = states if kind == "set" else TerminalGaussian(make_env(), states)
    env = TransformedEnv(make_env(), SkillChainReset(starts, probability=1.0))
    torch.testing.assert_close(env.reset()["observation"][:, 0], torch.full((3,), 0.7))


def test_a_set_goes_to_another_process_with_its_states():
    """As TorchRL hands a worker the environment's maker; its buffers refuse that."""
    for states in (termination_set(torch.tensor([[0.0, 1.0], [2.0, 3.0]])), TerminationSet(5), StateSet(3)):
        other = ForkingPickler.loads(ForkingPickler.dumps(states))
        assert type(other) is type(states) and len(other) == len(states)
        assert (other.capacity, other.changes) == (states.capacity, states.changes)
        if len(states):
            assert_close(other.all(), states.all())
            other.extend(other.all())
            assert len(other) == 2 * len(states)
