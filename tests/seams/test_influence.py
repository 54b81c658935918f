"""Whether a skill decides what the next one makes of its end: on variances worked by hand, and on a point."""

import math

import pytest
import torch
from point_chain import PointChain
from tensordict import TensorDict
from torchrl.envs.utils import ExplorationType, exploration_type

from tstar_rl.rollouts.collection import with_starts
from tstar_rl.rollouts.starts import make_starts
from tstar_rl.seams.influence import Repeated, influence_of, share_within


def of_groups(*outcomes: list[int]):
    groups = [index for index, row in enumerate(outcomes) for _ in row]
    return share_within(torch.tensor(groups), torch.tensor([bool(x) for row in outcomes for x in row]))


def test_a_start_that_decides_leaves_the_skill_nothing():
    assert of_groups([1, 1], [0, 0], [1, 1], [0, 0]) == (4, 0.5, 0.0)


def test_runs_from_one_start_that_differ_are_the_skills_own():
    """Every group has a mean of one half: nothing lies between them."""
    assert of_groups([1, 0], [0, 1], [1, 0]) == (3, 0.5, 1.0)


def test_the_two_shares_are_those_of_the_one_way_classification():
    """Groups (1, 1, 1, 0) and (0, 0, 0, 0): squares within .75 / 6 = .125, between 4 (.375^2 2) / 1 = 1.125."""
    found = of_groups([1, 1, 1, 0], [0, 0, 0, 0])
    between = (1.125 - 0.125) / 4
    assert found is not None
    assert found.within == pytest.approx(0.125 / (0.125 + between))


def test_a_start_with_one_run_says_nothing_and_equal_outcomes_have_no_variance():
    assert of_groups([1], [0]) is None
    found = of_groups([1, 1], [1, 1], [0])
    assert found is not None
    assert (found.starts, found.succeeded) == (2, 1.0) and math.isnan(found.within)


def test_one_start_has_nothing_to_be_compared_with():
    found = of_groups([1, 0, 1, 1], [1])
    assert found is not None
    assert (found.starts, found.succeeded) == (1, 0.75) and math.isnan(found.within)


def test_starts_are_handed_out_in_order_each_as_often_as_asked():
    rows = TensorDict({"snapshot": torch.arange(3).unsqueeze(-1)}, [3])
    drawn = Repeated(rows, 2).sample(7, torch.Generator())
    assert drawn["snapshot"].flatten().tolist() == [0, 0, 1, 1, 2, 2, 0]


@pytest.mark.parametrize(("noise", "least", "most"), [(0.0, 0.0, 0.01), (1.0, 0.25, 0.55)])
def test_on_the_point_noise_across_the_way_is_what_decides(noise, least, most):
    """Skill 1 succeeds where y > 0: skill 0 decides it as far as it moves y, here by .3 where starts spread by .6."""

    def make_env(subtask, number, starts):
        env = PointChain("point", number, subtask, snapshots=True, max_steps=30)
        return with_starts(env, *make_starts({"buffer": 1.0}, env, starts), 0)

    def walk(tensordict, spread):
        action = torch.zeros(len(tensordict), 9)
        action[:, 0] = 1.0
        action[:, 1] = spread * torch.randn(len(tensordict))
        return tensordict.set("action", action)

    torch.manual_seed(0)
    env = with_starts(PointChain("point", 40, 0, seed=3, snapshots=True))
    starts = env.reset().select("observation", "snapshot")
    policies = (lambda td: walk(td, noise), lambda td: walk(td, 0.0))
    found = influence_of(make_env, policies, 0, starts, times=6)
    assert found is not None and found.starts == 40
    assert least <= found.within <= most


def test_the_skill_draws_its_actions_and_the_next_one_does_not():
    used = {0: set(), 1: set()}

    def make_env(subtask, number, starts):
        env = PointChain("point", number, subtask, snapshots=True, max_steps=30)
        return with_starts(env, *make_starts({"buffer": 1.0}, env, starts), 0)

    def walk(index):
        def act(tensordict):
            used[index].add(exploration_type())
            return tensordict.set("action", torch.ones(len(tensordict), 9))

        return act

    env = with_starts(PointChain("point", 4, 0, seed=3, snapshots=True))
    influence_of(make_env, (walk(0), walk(1)), 0, env.reset().select("observation", "snapshot"), times=2)
    assert used == {0: {ExplorationType.RANDOM}, 1: {ExplorationType.DETERMINISTIC}}
