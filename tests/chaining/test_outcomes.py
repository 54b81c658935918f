"""What a trial tells of all starts, failed ones too, and what a skill keeps of it."""

from types import SimpleNamespace

import pytest
import torch
from point_chain import PointChain, make_skills
from tensordict import TensorDict
from torch.testing import assert_close

from tstar_rl.chaining.chain_training import ChainTraining
from tstar_rl.chaining.paths import PathLog
from tstar_rl.chaining.signals import StateValue, critic_errors, outcomes_of, value_scale
from tstar_rl.chaining.skill import APPROACH, Skill
from tstar_rl.chaining.trials import Trial, run_trial
from tstar_rl.models.network_settings import NetworkSettings
from tstar_rl.models.normalizer import Standardizer
from tstar_rl.rollouts.collection import with_starts

PATH = 3
SMALL = NetworkSettings(hidden=(8,), std="fixed", discriminator_hidden=(8,))


@pytest.fixture
def skills(tmp_path) -> list[Skill]:
    make_skills(tmp_path)
    return [Skill.load(tmp_path / f"runs/table_lack/gail_ppo/seed0/subtask{i}/last") for i in range(4)]


@pytest.fixture
def trial(skills) -> Trial:
    """Skill 1 succeeds where y > 0, and then so do all after it; no skill changes y."""
    return run_trial(skills, with_starts(PointChain("table_lack", 64, None, seed=3)), PATH)


def test_the_share_of_the_rest_that_was_done(trial):
    for index in range(4):
        above = trial.skills[index].starts[:, 1] > 0
        below = 0.25 if index == 0 else 0.0  # of four skills one; of the three from skill 1 on none
        expected = torch.where(above, 1.0, below).double()
        assert_close(trial.share_from(index), expected)


def test_paths_end_where_the_episodes_do(trial):
    """Three states of every episode, of failed ones too; y says which episode was handed over well."""
    for index, found in enumerate(trial.skills):
        path = found.path
        last = path.states[path.steps_left == 0]
        assert len(path.states) == PATH * len(found.starts) and len(last) == len(found.starts)
        assert path.simulation.unique().tolist() == found.simulations.sort().values.tolist()
        assert bool((last[:, 0] > index + 1).all())  # they arrived, or failed on arrival
        before = path.states[path.steps_left == 1]
        assert bool((before[:, 0] < index + 1).all())
        if index < 3:
            assert torch.equal(trial.handed_over(index), path.states[:, 1] > 0)
    ends = trial.skills[0].path.states[trial.skills[0].path.steps_left == 0]
    assert torch.equal(ends.sort(0).values, trial.skills[1].starts.sort(0).values)


def test_an_episode_gives_no_more_states_than_it_had_and_a_long_one_its_last():
    log = PathLog(3, 3)
    for step, running in enumerate(([1, 1, 1], [1, 1, 0], [0, 1, 0], [0, 1, 0])):
        log.add(10 * torch.arange(3.0).unsqueeze(-1) + step, torch.tensor(running, dtype=torch.bool))
    path = log.of(torch.arange(3))
    assert path.states.flatten().tolist() == [1, 0, 13, 12, 11, 20]
    assert path.steps_left.tolist() == [0, 1, 0, 1, 2, 0] and path.simulation.tolist() == [0, 0, 1, 1, 1, 2]


def test_a_trial_without_paths_is_the_same_otherwise(skills, trial):
    plain = run_trial(skills, with_starts(PointChain("table_lack", 64, None, seed=3)))
    assert not len(plain.skills[0].path.states) and torch.equal(plain.completed, trial.completed)
    for one, other in zip(plain.skills, trial.skills, strict=True):
        assert torch.equal(one.starts, other.starts) and torch.equal(one.succeeded, other.succeeded)


def chain_of(skills: list[Skill]) -> ChainTraining:
    return ChainTraining(skills, skills, None, SimpleNamespace(order="forward"), 1, None, None, None)  # pyright: ignore


@pytest.mark.parametrize("wrong", ["succeeded", "share"])
def test_outcomes_of_another_shape_are_refused(skills, wrong):
    given = {"succeeded": torch.ones(3, dtype=torch.bool), "share": torch.ones(3)}
    given[wrong] = given[wrong].unsqueeze(-1)
    with pytest.raises(
        ValueError, match=rf"{wrong} must have a number for each of the 3 states, .*got \(3, 1\)"
    ):
        skills[1].outcomes.add(torch.zeros(3, 72), **given)
    paths = {"steps_left": torch.arange(3), "handed_over": torch.ones(3, 1, dtype=torch.bool)}
    with pytest.raises(ValueError, match=r"handed_over must have a number for each .*got \(3, 1\)"):
        skills[1].approaches.add(torch.zeros(3, 72), **paths)


def test_a_chain_keeps_failed_starts(skills, trial):
    chain_of(skills).keep_outcomes(trial)
    outcomes, found = skills[1].outcomes, trial.skills[1]
    assert torch.equal(outcomes.observations(), found.starts)
    assert torch.equal(outcomes.labels("success"), found.succeeded.float())
    assert 0 < outcomes.labels("success").mean() < 1
    shares = skills[0].outcomes.labels("share")
    assert shares.unique().tolist() == [0.25, 1.0] and skills[0].outcomes.labels("success").min() == 1
    near = skills[1].approaches.proximities(0.5)
    good = skills[1].approaches.observations()[:, 1] > 0
    assert bool((near[~good] == 0).all()) and near[good].unique().tolist() == [0.25, 0.5, 1.0]
    assert not len(skills[0].approaches)  # nothing comes before the first skill
    with pytest.raises(ValueError, match="label must be one of success, share; got 'succes'"):
        outcomes.labels("succes")


def test_of_a_rejected_turn_only_what_comes_after_is_kept(skills, trial):
    """Skill 1 is put back: what it did is not what it does now. Skills 2 and 3 are as they were."""
    chain_of(skills).keep_outcomes(trial, rejected=1)
    assert [len(skill.outcomes) > 0 for skill in skills] == [False, False, True, True]
    assert [len(skill.approaches) > 0 for skill in skills] == [False, False, False, True]


def rollout() -> TensorDict:
    """Two episodes that end, one in success, and one that goes on; observations of one number."""
    start, then = torch.tensor([[1.0], [2.0], [3.0]]), torch.tensor([[1.5], [2.5], [3.5]])
    flags = {"done": [True, True, False], "terminated": [True, False, False], "success": [True, False, False]}
    after = {name: torch.tensor(values).unsqueeze(-1) for name, values in flags.items()}
    after |= {"observation": then, "reward": torch.tensor([[4.0], [2.0], [0.0]])}
    after["step_count"] = torch.tensor([[1], [1], [2]])
    rows = {"observation": start, "start_observation": start, "next": TensorDict(after, [3])}
    return TensorDict(rows, [3])


def test_outcomes_of_a_rollout_are_those_of_episodes_that_ended():
    starts, succeeded, share = outcomes_of(rollout(), 3, lambda obs: obs - 1.0)  # .5 of what comes after 1.5
    assert starts.tolist() == [[1.0], [2.0]] and succeeded.tolist() == [True, False]
    assert_close(share, torch.tensor([2 / 3, 0.0]))
    assert_close(outcomes_of(rollout(), 3, lambda obs: obs)[2], torch.tensor([1.0, 0.0]))  # no more than all
    assert_close(outcomes_of(rollout(), 1, None)[2], torch.tensor([1.0, 0.0]))


class Doubled(torch.nn.Module):
    def forward(self, tensordict: TensorDict) -> TensorDict:
        return tensordict.set("state_value", 2 * tensordict["observation"])


def test_errors_of_a_critic_are_those_of_first_steps():
    # V = 2 x, rewards halved. First: 2 - 2 = 0 (it terminated); second: 1 + .5 * 5 - 4 = -.5; the third: none.
    skill = SimpleNamespace(value=Doubled())
    states, errors = critic_errors(rollout(), skill, gamma=0.5, reward_scale=2.0, scale=0.5)  # pyright: ignore
    assert states.tolist() == [[1.0], [2.0]]
    assert_close(errors, torch.tensor([0.0, 1.0]))  # (-.5 / .5)^2


def test_the_value_that_counts_as_one(skills):
    skill = skills[1]
    assert value_scale(skill, 7.0) == 7.0 and value_scale(skill) is None  # no states yet
    skill.value = Doubled()  # pyright: ignore[reportAttributeAccessIssue]
    states = torch.zeros(2, 72)
    skill.initiation_set.extend(TensorDict({"observation": states + 3.0}, [2]))
    assert value_scale(skill) == pytest.approx(6.0)
    assert StateValue(skill)(states + 1.0)[0, 0] == 2.0
    skill.initiation_set.extend(TensorDict({"observation": states - 5.0}, [2]))
    assert value_scale(skill) is None  # a mean that is not positive is no unit


def test_sets_and_a_standardised_network_come_back(tmp_path):
    skill = Skill("table_lack", 1, SMALL)
    states = torch.randn(30, 72)
    skill.normalizer.fit(states, 0.02)
    skill.outcomes.add(states, states[:, 0] > 0, states[:, 0].sigmoid())
    skill.approaches.add(states, torch.arange(30), states[:, 0] > 0)
    network = skill.add_network("feasibility", 1e-4)
    network.normalizer.standardize(100 * states)
    before = skill.normalizer.loc.clone()
    skill.save(tmp_path / "skill")
    back = Skill.load(tmp_path / "skill")
    assert torch.equal(back.networks["feasibility"](states), network(states))
    assert isinstance(back.networks["feasibility"].normalizer, Standardizer)
    assert torch.equal(back.normalizer.loc, before)  # not overwritten by the other network's statistics
    assert torch.equal(back.outcomes.labels("share"), skill.outcomes.labels("share"))
    assert torch.equal(back.approaches.proximities(0.9), skill.approaches.proximities(0.9))
    assert back.approaches.capacity == APPROACH * back.outcomes.capacity


def test_a_skill_of_before_these_sets_begins_with_none():
    skill, old = Skill("table_lack", 1, SMALL), Skill("table_lack", 1, SMALL).state_dict()
    del old["sets"]["outcomes"], old["sets"]["approaches"]
    skill.outcomes.add(torch.zeros(1, 72), torch.ones(1), torch.ones(1))
    skill.load_state_dict(old)
    assert not len(skill.outcomes) and not len(skill.approaches)
