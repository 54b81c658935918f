"""Mixtures of starts draw by their shares, and say what is wrong with them."""

import pytest
import torch
from tensordict import TensorDict, assert_close
from torchrl.envs import Compose, StepCounter, TransformedEnv

from tstar_rl.rollouts.collection import Collection, with_starts
from tstar_rl.rollouts.starts import (
    MixedStarts,
    check_shares,
    gaussian_counts,
    load_state_of_sources,
    make_starts,
    start_counts,
    state_of_sources,
    termination_sets,
)
from tstar_rl.rollouts.state_sets import TerminationSet
from tstar_rl.rollouts.terminal_gaussian import TerminalGaussian
from tstar_rl.transforms import SkillChainReset


def seeded(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def snapshots(positions: torch.Tensor) -> TensorDict:
    """Of `PointEnv`, at positions (n,)."""
    n = len(positions)
    physics = torch.zeros(n, 4, dtype=torch.float64)
    physics[:, 0] = positions
    task = TensorDict({"steps": torch.zeros(n, dtype=torch.int64)}, [n])
    welds = torch.zeros(n, 2, 11, dtype=torch.float64)
    return TensorDict({"physics": physics, "welds": welds, "task": task}, [n])


class At:
    """Starts at one position; the n-th of a call has n in its second number."""

    def __init__(self, position: float, empty: bool = False, as_rows: bool = False) -> None:
        self.position, self.empty, self.as_rows = position, empty, as_rows

    def sample(self, n, generator):
        found = snapshots(torch.full((0 if self.empty else n,), self.position))
        found["physics"][:, 1] = torch.arange(len(found), dtype=torch.float64)
        return TensorDict({"snapshot": found}, found.batch_size) if self.as_rows else found


def reached(position: float) -> TerminationSet:
    states = TerminationSet(100)
    found = snapshots(torch.full((20,), position))
    states.extend(TensorDict({"observation": torch.zeros(20, 72), "snapshot": found}, [20]))
    return states


def test_sources_are_drawn_by_their_shares():
    drawn = MixedStarts([At(0.25), At(0.75, as_rows=True)], [0.1, 0.7]).sample(8000, seeded())
    assert drawn.batch_size == (8000,)
    # 1 in 8 from the first: 1000, with a deviation of 30.
    first = drawn["physics"][:, 0] == 0.25
    assert 900 < int(first.sum()) < 1100 and (drawn["physics"][~first, 0] == 0.75).all()
    # Sources are mixed row by row, and each row of a source is used once.
    assert 400 < int(first[:4000].sum()) < 600
    for rows in (first, ~first):
        assert torch.equal(drawn["physics"][rows, 1], torch.arange(int(rows.sum())).double())


def test_draws_follow_the_generator():
    starts = MixedStarts([At(0.25), At(0.75)], [0.5, 0.5])
    assert_close(starts.sample(50, seeded(1)), starts.sample(50, seeded(1)))
    assert (starts.sample(50, seeded(1)) != starts.sample(50, seeded(2))).any()


def test_while_a_source_is_empty_the_environment_begins(make_env):
    starts = MixedStarts([At(0.25, empty=True), At(0.75)], [0.5, 0.5])
    assert starts.sample(50, seeded()).batch_size == (0,)
    env = with_starts(make_env(num_envs=40), starts, probability=1.0)
    assert (env.reset()["observation"][:, 0] < 0.2).all()


def test_episodes_begin_in_the_shares_of_the_released_code(make_env):
    base, states = make_env(num_envs=4000), reached(0.7)
    source, probability = make_starts({"environment": 0.2, "gaussian": 0.1, "buffer": 0.7}, base, states)
    assert isinstance(source, MixedStarts) and probability == pytest.approx(0.8)
    assert source.shares.tolist() == pytest.approx([0.125, 0.875])
    env = with_starts(base, source, probability, seed=0)
    position = env.reset()["observation"][:, 0]
    chained = int((position > 0.5).sum())
    assert 3100 < chained < 3300  # 80%, with a deviation of 25
    drawn = gaussian_counts(env)["gaussian_drawn"]
    assert 340 < drawn < 460  # 10%, with a deviation of 19


@pytest.mark.parametrize(
    ("shares", "kind", "probability"),
    [
        ({"environment": 0.2, "buffer": 0.8}, TerminationSet, 0.8),
        ({"environment": 0.2, "gaussian": 0.8}, TerminalGaussian, 0.8),
        ({"environment": 1.0}, TerminationSet, 0.0),
        ({"buffer": 1.0}, TerminationSet, 1.0),
    ],
)
def test_one_source_needs_no_mixture(shares, kind, probability, make_env):
    source, share = make_starts(shares, make_env(), reached(0.7))
    assert isinstance(source, kind) and share == pytest.approx(probability)


def test_the_log_counts_where_episodes_have_begun(make_env, policy):
    """All of the first rollout in the environment, since the set is empty; of later ones, about a fifth."""
    states = TerminationSet(100)
    collection = Collection(with_starts(make_env(num_envs=200), states, 0.8), policy, 3)
    first = collection.rollout()
    counts = collection.counts()
    assert counts["starts_chained"] == 0 and counts["starts_environment"] >= 200
    states.extend_from(first)
    before = counts["starts_environment"]
    begun = 0
    for _ in range(4):
        rollout = collection.rollout()
        begun += int(((rollout["next", "step_count"] == 1) & rollout["start_chained"]).sum())
    counts = collection.counts()
    assert 0.7 < counts["starts_chained"] / (sum(counts.values()) - before) < 0.9
    assert counts["starts_chained"] >= begun > 0  # some begin with the next rollout
    assert Collection(with_starts(make_env()), policy, 3).counts() == {}


@pytest.mark.parametrize("wrap", [lambda one: one, lambda one: Compose(StepCounter(), Compose(one))])
def test_starts_are_found_wherever_their_transform_stands(wrap, make_env, policy):
    states = reached(0.7)
    env = TransformedEnv(make_env(), wrap(SkillChainReset(states, probability=1.0)))
    env.rollout(2, policy)
    assert start_counts(env) == {"starts_environment": 0, "starts_chained": 3}
    assert termination_sets(env) == [states]


def test_only_a_gaussian_counts(make_env):
    assert gaussian_counts(with_starts(make_env(), reached(0.7))) == {}
    assert gaussian_counts(with_starts(make_env())) == {}


@pytest.mark.parametrize(
    ("shares", "message"),
    [
        ({"enviroment": 1.0}, "no source enviroment; valid: environment, gaussian, buffer"),
        ({"environment": 0.2, "buffer": 0.7}, r"sum to 1 \(chain.starts\), got .*'buffer': 0.7"),
        ({"environment": 1.2, "buffer": -0.2}, "must not be negative"),
    ],
)
def test_wrong_shares_are_named(shares, message):
    with pytest.raises(ValueError, match=message):
        check_shares(shares)


def test_a_mixture_needs_a_share_for_each_source():
    with pytest.raises(ValueError, match=r"got 1 sources, shares \[0.5, 0.5\]"):
        MixedStarts([At(0.25)], [0.5, 0.5])


class Further(At):
    """A curriculum: every call begins a tenth further on."""

    def sample(self, n, generator):
        self.position += 0.1
        return super().sample(n, generator)

    def state_dict(self):
        return {"position": self.position}

    def load_state_dict(self, state):
        self.position = state["position"]


@pytest.mark.parametrize("nested", [False, True])
def test_a_source_that_changes_is_saved_and_goes_on(make_env, nested):
    """Beside one that says nothing of itself, and a set that is saved with its skill; also in a mixture of mixtures."""

    def env_from(position: float) -> tuple[TransformedEnv, Further]:
        changing = Further(position)
        source = MixedStarts([At(0.5), changing, reached(0.7)], [0.3, 0.4, 0.3])
        source = MixedStarts([At(0.5), source], [0.1, 0.9]) if nested else source
        return with_starts(make_env(num_envs=30), source, 1.0), changing

    (first, moved), (second, still) = env_from(0.1), env_from(0.1)
    first.reset()
    states = state_of_sources(first)
    assert states == [{"position": pytest.approx(0.2)}]
    load_state_of_sources(second, states)
    assert still.position == moved.position
    load_state_of_sources(second, [])  # what a run of before has kept
    assert still.position == moved.position
