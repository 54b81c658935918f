"""What a trial of a chain tells of each skill and which chain is the best, and what of it need not be found again."""

import pytest
import torch
from point_chain import PointChain, make_skills
from torch.testing import assert_close
from torchrl.envs import ExplorationType, TransformedEnv, set_exploration_type

from tstar_rl.chaining.chain import ChainPolicy, load_chain
from tstar_rl.chaining.skill import Skill
from tstar_rl.chaining.training import Training
from tstar_rl.chaining.trials import Trial, run_trial
from tstar_rl.checks import InvalidValueError
from tstar_rl.rollouts.collection import with_starts
from tstar_rl.rollouts.episodes import run_episodes
from tstar_rl.rollouts.hand_overs import HandOvers
from tstar_rl.runs import checkpoint


@pytest.fixture
def skills(tmp_path) -> list[Skill]:
    make_skills(tmp_path)
    return [Skill.load(tmp_path / f"runs/table_lack/gail_ppo/seed0/subtask{i}/last") for i in range(4)]


def test_a_trial_says_where_every_skill_began_and_how_it_did(skills):
    """Skill 0 ends at any y; skill 1 then fails where y < 0, and whoever gets past it succeeds to the end."""
    n = 64
    trial = run_trial(skills, with_starts(PointChain("table_lack", n, None, seed=3)))
    sides = trial.skills[1].starts[:, 1] > 0
    above = int(sides.sum())
    assert 0 < above < n and torch.equal(trial.skills[1].succeeded, sides)
    assert trial.completed.unique().tolist() == [1, 4] and int((trial.completed == 4).sum()) == above
    assert trial.progress == pytest.approx((above * 4 + (n - above)) / (4 * n))
    assert [len(skill.starts) for skill in trial.skills] == [n, n, above, above]
    assert [skill.success for skill in trial.skills] == [1, above / n, 1, 1]
    for index, skill in enumerate(trial.skills):
        x = skill.ends["observation"][:, 0]
        assert len(x) == int(skill.succeeded.sum()) and bool(((x > index + 1) & (x < index + 2)).all())
        assert torch.equal(skill.ends["snapshot", "physics"][:, 0].float(), x)
        assert (skill.ends["snapshot", "task", "subtask"] == index + 1).all()
    ends = trial.skills[0].ends["observation"]
    assert torch.equal(ends, trial.skills[1].starts)  # where one ends the next begins


def test_a_trial_of_a_shorter_chain_ends_where_the_chain_does(skills):
    env = with_starts(PointChain("table_lack", 16, None, seed=3))
    trial = run_trial(skills[:1], env)
    assert trial.progress == 1 and len(trial.skills) == 1
    assert trial.steps() == int(env.base_env.steps.sum()) < 16 * 5


class Deaf(PointChain):
    """It always begins in a start of its own, as an environment does whose author forgot what a reset is given."""

    def _reset(self, tensordict=None, **kwargs):
        return super()._reset(None if tensordict is None else tensordict.exclude("start"), **kwargs)


def test_an_environment_that_does_not_begin_where_it_is_told_is_refused(skills):
    env = with_starts(Deaf("table_lack", 16, None, seed=3))
    with pytest.raises(InvalidValueError, match="skill 1 did not begin where skill 0 ended: at a reset"):
        run_trial(skills, env)
    assert env.is_closed


class Noisy(PointChain):
    """Most of what it observes is noise, and one number is the last action: 0 after a reset."""

    def _out(self, *ended):
        out = super()._out(*ended)
        seen = out["observation"]
        seen[:, 3:] = torch.randn(seen[:, 3:].shape, generator=self.generator)
        seen[:, 2] = self.steps > 0
        return out


def test_an_environment_whose_observations_are_noisy_is_none_that_does_not_begin_where_it_is_told(skills):
    assert run_trial(skills, with_starts(Noisy("table_lack", 16, None, seed=3))).progress > 0.3


def test_what_makes_no_chain_is_not_tried(skills):
    with pytest.raises(InvalidValueError, match=r"subtasks 0, 1, ... in order; got \[1, 0\]"):
        run_trial(skills[1::-1], with_starts(PointChain("table_lack", 4, None, seed=3)))


class Breaking(PointChain):
    """Its simulations 0 and 1 break in the step in which they arrive, as where MuJoCo gives up: nothing is joined."""

    def _step(self, tensordict):
        before = self.now[:2].clone()
        out = super()._step(tensordict)
        broken = self.now[:2] > before
        for name, mine in (("subtask", self.now), ("completed", self.completed)):
            mine[:2] -= broken.long()
            out[name][:2, 0] = mine[:2]
        out["terminated"][:2, 0] |= broken
        out["done"][:2, 0] |= broken
        out["success"][:2, 0] &= ~broken
        return out


class Disturbed(PointChain):
    """Its simulations 0 and 1 end in the step in which they do the first subtask, as with end_on_disturbance."""

    def _step(self, tensordict):
        before = self.now[:2].clone()
        out = super()._step(tensordict)
        over = (self.now[:2] > before) & (self.now[:2] == 1)
        for name in ("terminated", "done"):
            out[name][:2, 0] |= over
        return out


@pytest.mark.parametrize(
    ("kind", "limit"), [*((PointChain, limit) for limit in range(2, 11)), (Disturbed, 32)]
)
def test_what_ends_as_it_is_joined_counts_and_is_handed_to_nobody(skills, kind, limit):
    """A trial runs skill after skill, an evaluation the chain from end to end: both say the same."""

    def env():
        made = with_starts(kind("table_lack", 32, None, seed=3))
        made.base_env.max_steps = limit
        return made

    trial, hand_overs = run_trial(skills, env()), HandOvers(4)
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        last = run_episodes(env(), ChainPolicy(skills), hand_overs)
    assert torch.equal(trial.completed, last["next", "completed"].squeeze(-1))
    for seam, found in zip(hand_overs.seams(), trial.skills[1:], strict=True):
        assert torch.equal(seam.observations, found.starts) and torch.equal(seam.succeeded, found.succeeded)
    assert trial.steps() == int(last["next", "step_count"].sum())


def test_a_simulation_that_breaks_as_it_arrives_has_not_succeeded(skills):
    trial = run_trial(skills, with_starts(Breaking("table_lack", 16, None, seed=3)))
    assert trial.skills[0].succeeded.tolist() == [False] * 2 + [True] * 14
    assert trial.completed[:2].tolist() == [0, 0] and trial.skills[1].simulations.tolist() == list(
        range(2, 16)
    )


def assert_same(one: Trial, other: Trial) -> None:
    """Whether two trials say the same, to the bit."""
    for this, that in zip(one.skills, other.skills, strict=True):
        for name in ("starts", "succeeded", "ends", "over", "simulations"):
            assert_close(getattr(this, name), getattr(that, name), rtol=0, atol=0, equal_nan=True)
        for mine, theirs in zip(this.path, that.path, strict=True):
            assert torch.equal(mine, theirs)
        assert this.steps == that.steps


@pytest.mark.parametrize("first", [0, 1, 3])
def test_what_is_known_of_the_skills_before_is_not_run_again(skills, first):
    """Skill `first` is made to walk sideways; a trial that begins with it says what a whole one does."""

    def env():
        return with_starts(PointChain("table_lack", 32, None, seed=3))

    known = run_trial(skills, env(), path_steps=2)
    skills[first].policy[0][1].module[0][-1].bias.data[1] = -0.3
    whole, rest = run_trial(skills, env(), 2), run_trial(skills, env(), 2, known, first)
    assert_same(whole, rest)
    assert whole.progress != known.progress and len(known.skills) == 4
    assert all(mine is theirs for mine, theirs in zip(rest.skills[:first], known.skills, strict=False))
    assert rest.steps(first) == sum(found.steps for found in whole.skills[first:])


def test_skills_after_one_that_never_succeeds_have_no_episodes(skills):
    skills[1].policy[0][1].module[0][-1].bias.data[0] = -1.0  # it walks back
    trial = run_trial(skills, with_starts(PointChain("table_lack", 8, None, seed=3)), path_steps=2)
    assert trial.completed.tolist() == [1] * 8 and trial.progress == 0.25
    assert [found.steps > 0 for found in trial.skills] == [True, True, False, False]
    assert [len(found.starts) for found in trial.skills] == [8, 8, 0, 0] and not len(
        trial.skills[3].path.states
    )


@pytest.mark.parametrize("gate", [False, True])
def test_the_best_chain_is_that_of_the_best_trial(gate, point_chain, tmp_path, monkeypatch):
    """The second turn leaves a skill that walks backwards; a gate puts it back."""
    finish = Training._finish_rollout

    def spoil(training, rollout):
        if training.run.turn == 1:
            training.skill.policy[0][1].module[0][-1].bias.data[0] = -1.0
        return finish(training, rollout)

    monkeypatch.setattr(Training, "_finish_rollout", spoil)
    values = (
        f"chain.gate={str(gate).lower()}",
        "chain.trial_every=1",
        "chain.links=2",
        "chain.steps_per_turn=512",
    )
    point_chain("tstar", *values)
    places = [tmp_path / f"runs/table_lack/tstar/seed0/{name}" for name in ("best", "last")]
    best, last = (float(load_chain(p)[1].policy[0][1].module[0][-1].bias.data[0]) for p in places)
    assert (last == -1.0) is not gate and best > 0
    assert checkpoint.read_record(places[0] / "skill0")["env_steps"] == (
        1024 if gate else 512
    )  # of equals, the later


def test_an_environment_that_counts_no_steps_is_told_before_the_first_one(skills):
    with pytest.raises(InvalidValueError, match=r"with a StepCounter: with_starts\(env\) adds it"):
        run_trial(skills, TransformedEnv(PointChain("table_lack", 4, None, seed=3)))
