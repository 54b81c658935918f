"""Episodes and what is told of them: intervals, progress, films, and when two policies are the same."""

import copy
import math

import pytest
import torch
from tensordict import TensorDict

from tstar_rl.intervals import wilson_interval
from tstar_rl.models.networks import make_policy, set_action_std
from tstar_rl.rollouts.collection import with_starts
from tstar_rl.rollouts.episodes import check_modes, evaluate, run_episodes, same_policy, summarize
from tstar_rl.rollouts.recorder import Recorder


def test_an_unknown_mode_is_named():
    with pytest.raises(ValueError, match="mode must be one of deterministic, stochastic; got 'det'"):
        check_modes(["deterministic", "det"])


def test_wilson_by_hand():
    # 8 of 10 at z = 1.96: centre (0.8 + 3.8416 / 20) / 1.38416 = 0.71674, half width 0.22657.
    low, high = wilson_interval(8, 10)
    assert (low, high) == (pytest.approx(0.4902, abs=2e-4), pytest.approx(0.9433, abs=2e-4))
    assert wilson_interval(10, 10)[1] == pytest.approx(1.0)
    with pytest.raises(ValueError, match="got 3 of 2"):
        wilson_interval(3, 2)


def test_progress_is_the_mean_share_of_subtasks():
    last = TensorDict(
        {
            "next": {
                "success": torch.tensor([[True], [False], [False], [False]]),
                "completed": torch.tensor([[4], [2], [1], [0]]),
                "step_count": torch.tensor([[300], [800], [800], [800]]),
            }
        },
        [4],
    )
    row = summarize(last, 4, None)
    assert row["progress"] == pytest.approx(7 / 16) and row["success"] == 0.25
    assert (row["success_low"], row["success_high"]) == wilson_interval(1, 4)
    assert [row[f"subtask_{k}"] for k in range(4)] == [0.75, 0.5, 0.25, 0.25]
    shorter = summarize(last, 4, None, links=2)  # done: 2, 2, 1, 0 of two
    assert shorter["progress"] == pytest.approx(5 / 8) and shorter["success"] == 0.5
    assert [shorter["subtask_0"], shorter["subtask_1"]] == [0.75, 0.5] and math.isnan(shorter["subtask_2"])


def test_a_skill_alone_has_done_all_that_it_is_to_do_where_it_succeeds():
    succeeded = torch.tensor([[True], [False], [True], [True]])
    following = {"success": succeeded, "completed": succeeded.long(), "step_count": torch.full((4, 1), 10)}
    row = summarize(TensorDict({"next": following}, [4]), 4, 2)
    assert row["progress"] == row["success"] == row["subtask_2"] == 0.75
    assert all(math.isnan(row[f"subtask_{other}"]) for other in (0, 1, 3))


def test_run_episodes_gives_the_last_step_of_each_first_episode(make_env, policy):
    env = with_starts(make_env(num_envs=6))
    seen = []
    last = run_episodes(env, policy, lambda td: seen.append(td["next", "done"].clone()))
    assert last["next", "success"].all()
    first_done = torch.stack(seen).squeeze(-1).int().argmax(0) + 1
    assert torch.equal(last["next", "step_count"].squeeze(-1), first_done)
    assert (last["start_observation"][:, 0] <= 0.2).all()


def test_episodes_of_no_simulation_are_refused(make_env, policy):
    env = with_starts(make_env())
    with pytest.raises(ValueError, match="rows must be true for one simulation at least"):
        run_episodes(env, policy, rows=torch.zeros(env.batch_size, dtype=torch.bool))


def test_policies_are_the_same_with_equal_weights_and_deviations_only():
    first = make_policy(4, 2, hidden=(8,), std="fixed")
    second = copy.deepcopy(first)
    assert same_policy(first, second)
    set_action_std(second, 0.2)
    assert not same_policy(first, second)
    other = copy.deepcopy(first)
    with torch.no_grad():
        next(other.parameters()).add_(1e-6)
    assert not same_policy(first, other)


class Film:
    """Stands for an environment that can draw: keeps what it is asked to film."""

    def __init__(self) -> None:
        self.films = {}

    def qpos_of(self, snapshot):
        return snapshot["qpos"]

    def write_mp4(self, path, positions):
        path.write_bytes(b"new")
        self.films[path.name] = positions
        return True

    def write_player(self, path, episodes):
        path.write_bytes(b"new")
        self.films[path.name] = episodes
        return path


def record(folder, number, won):
    """Simulation i is at i + t / 10 after step t and ends its episode, as `won` says, after min(i, 2) more."""
    env, count = Film(), len(won)
    recorder = Recorder(env, number)
    index = torch.arange(count).unsqueeze(-1)
    for step in range(3):
        done = index.clamp(max=2) == step
        success = done & torch.tensor(won).unsqueeze(-1)
        rest = {"subtask": torch.zeros_like(index), "phase": index, "reward_env": 10.0 * index + step}
        rows = {"success": success, "done": done, **rest}
        before, after = (
            TensorDict({"qpos": (index + at).double()}, [count]) for at in (step / 10 - 0.1, step / 10)
        )
        recorder(TensorDict({"snapshot": before, **rest, "next": {"snapshot": after, **rows}}, [count]))
    return env.films, [path.name for path in recorder.write(folder)]


def test_the_first_success_and_the_first_failure_of_all_episodes_are_filmed(tmp_path):
    films, written = record(tmp_path, None, [True, True, True, False, False])
    assert written == ["first_failure.mp4", "first_success.mp4", "episodes.html"]
    torch.testing.assert_close(films["first_success.mp4"], torch.tensor([[0.0]]))
    torch.testing.assert_close(films["first_failure.mp4"], torch.tensor([[3.0], [3.1], [3.2]]))
    failure, success = films["episodes.html"]
    assert (failure["title"], failure["success"]) == ("first failure", False)
    assert (success["title"], success["success"]) == ("first success", True)
    assert failure["positions"][:, 0].tolist() == pytest.approx(
        [2.9, 3.0, 3.1, 3.2]
    )  # the state before the first step too
    assert failure["reward"].tolist() == [30.0, 31.0, 32.0] and failure["phase"].tolist() == [3] * 4


def test_the_film_of_a_failure_ends_soon_after_the_last_subtask_that_was_done(tmp_path, monkeypatch):
    monkeypatch.setattr("tstar_rl.rollouts.recorder.STUCK", 3)
    env = Film()
    recorder, subtasks = Recorder(env), [0, 0, 1, 1, 1, 1, 1, 1, 1]  # done in step 2 of 8
    for step in range(8):
        row = {"success": False, "done": step == 7, "reward_env": 0.0, "phase": 0}
        before, after = (
            {"snapshot": {"qpos": torch.full((1, 1), float(at))}, "subtask": torch.tensor([[subtasks[at]]])}
            for at in (step, step + 1)
        )
        rest = {name: torch.tensor([[value]]) for name, value in row.items()}
        recorder(TensorDict({**before, **rest, "next": {**after, **rest}}, [1]))
    recorder.write(tmp_path)
    assert env.films["first_failure.mp4"].flatten().tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]
    assert len(env.films["episodes.html"][0]["positions"]) == 9  # the page has all of it


def test_films_of_an_earlier_evaluation_do_not_stay(tmp_path):
    for name in ("first_success.mp4", "first_failure.mp4"):
        (tmp_path / name).write_bytes(b"old")
    assert record(tmp_path, 0, [True, False]) == ({}, [])
    assert (tmp_path / "first_failure.mp4").read_bytes() == b"old"  # nothing was to be filmed
    assert record(tmp_path, 3, [True, True, True, False])[1] == ["first_success.mp4", "episodes.html"]
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"new", b"new"]
    with pytest.raises(ValueError, match="number must not be negative, got -1"):
        Recorder(Film(), -1)


def test_evaluate_refuses_another_mode(make_env, policy):
    with pytest.raises(ValueError, match="deterministic, stochastic; got 'greedy'"):
        evaluate(policy, with_starts(make_env()), "greedy")


@pytest.mark.parametrize(("mode", "mean"), [("deterministic", True), ("stochastic", False)])
def test_a_mode_says_whether_actions_are_drawn(mode, mean, make_env):
    policy, seen = make_policy(72, std="fixed", action_std=0.3), []
    env = with_starts(make_env(num_envs=4))
    evaluate(policy, env, mode, lambda step: seen.append(torch.allclose(step["action"], step["loc"])))
    assert set(seen) == {mean}
