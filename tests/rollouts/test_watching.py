"""What is remembered of episodes to play them: states and steps of the first one, and what d_omega says at its ends."""

import pytest
import torch
from point_chain import PointChain
from tensordict import TensorDict
from torchrl.envs import TransformedEnv

from tstar_rl.checks import InvalidValueError
from tstar_rl.rollouts.collection import with_starts
from tstar_rl.rollouts.episodes import run_episodes
from tstar_rl.rollouts.watching import EpisodeLog, d_omega_signal, record_episode, rows_to_show


def test_an_episode_is_remembered_up_to_its_end(make_env, policy):
    env = with_starts(make_env(num_envs=5))
    log = EpisodeLog(env.base_env)
    last = run_episodes(env, policy, log)
    assert torch.equal(log.lengths(), last["next", "step_count"].squeeze(-1))
    assert log.successes().all()
    for row in range(5):
        episode = log.episode(row, "any")
        steps = int(log.lengths()[row])
        place = torch.from_numpy(episode["positions"])[:, 0]
        assert (
            place.shape == (steps + 1,) and place[0] <= 0.2 and place[-1] > 1
        )  # from its start to its success
        torch.testing.assert_close(place.diff(), torch.full((steps,), 0.4))
        assert episode["reward"].shape == (steps,) and episode["reward"][-1] == pytest.approx(10.8)
        assert torch.equal(torch.from_numpy(episode["positions"]), log.positions(row))


def test_a_shorter_chain_has_succeeded_after_its_last_link(policy):
    env = with_starts(PointChain("table_lack", num_envs=20, snapshots=True))
    log = EpisodeLog(env.base_env, enough=2)
    last = run_episodes(env, policy, log, enough=2)
    done = (last["next", "completed"] == 2).squeeze(-1)
    assert done.any() and not last["next", "success"].any()  # the environment has four subtasks
    assert torch.equal(log.successes(), done)
    assert torch.equal(log.lengths(), last["next", "step_count"].squeeze(-1))
    env = with_starts(PointChain("table_lack", num_envs=20, snapshots=True))
    assert record_episode(env, policy, "two links", success=True, enough=2)["success"]


def test_the_first_episode_that_ended_so_is_given(make_env):
    def third_alone_succeeds(tensordict):
        action = torch.full((4, 9), -0.8)
        action[2] = 0.8
        return tensordict.set("action", action)

    signals = {"place": lambda step: step["next", "observation"][:, 0]}
    for success, last in ((True, 1.2), (False, -1.2), (None, -1.2)):
        env = with_starts(make_env(num_envs=4))
        episode = record_episode(env, third_alone_succeeds, "any", success, signals)
        assert episode["success"] is (success is True)
        assert episode["series"]["place"][-1] == pytest.approx(last, abs=0.2)
        assert len(episode["series"]["place"]) == len(episode["reward"])


class Ended:
    """A log of episodes of which it is only known how they ended."""

    def __init__(self, *successes: bool) -> None:
        self.known = torch.tensor(successes)

    def successes(self) -> torch.Tensor:
        return self.known


def test_the_same_simulation_is_shown_where_all_ended_as_wanted():
    failing, mended = Ended(True, False, False), Ended(False, False, True)
    assert rows_to_show([failing, mended], [False, True]) == [2, 2]
    assert rows_to_show([failing, Ended(True, False, False)], [False, True]) == [1, 0]  # each its own first
    assert rows_to_show([Ended(True, True), Ended(False, True)], [False, True]) == [0, 1]  # none failed


def test_where_none_ended_so_the_first_is_given(make_env, policy):
    assert record_episode(with_starts(make_env()), policy, "any", success=False)["success"]


def test_d_omega_of_the_next_skill_speaks_where_a_subtask_was_done():
    # Rows: subtask 0 done, 1 goes on, 1 done, 2 (the last) done.
    before, after = (torch.tensor(values).unsqueeze(-1) for values in ([0, 1, 1, 2], [1, 1, 2, 3]))
    observation = torch.tensor([[0.25], [0.5], [0.75], [1.0]])
    step = TensorDict({"subtask": before, "next": {"subtask": after, "observation": observation}}, [4])
    said = d_omega_signal([lambda o: o + 0.5, lambda o: o + 0.5])(step)
    torch.testing.assert_close(said, torch.tensor([0.75, torch.nan, 1.0, torch.nan]), equal_nan=True)


def test_an_environment_without_snapshots_or_a_step_count_is_told_so(policy):
    for env in (
        with_starts(PointChain("table_lack", 2)),
        TransformedEnv(PointChain("table_lack", 2, snapshots=True)),
    ):
        with pytest.raises(InvalidValueError, match="recorded of with_starts.*: this environment has no"):
            record_episode(env, policy, "mine")
