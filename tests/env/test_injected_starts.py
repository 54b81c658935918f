"""Episodes that begin in a snapshot which the TorchRL front is given."""

import pytest
import torch
from table_envs import make, still, until_success
from tensordict import TensorDict

from tstar_rl.rollouts.collection import with_starts
from tstar_rl.rollouts.state_sets import TerminationSet


def test_a_success_row_is_a_start_of_the_next_subtask():
    env = make(4, snapshots=True)
    step = until_success(env)["next"]
    row = int(step["success"].flatten().nonzero()[0])
    assert step["terminated"][row] and step["done"][row] and not step["truncated"][row]
    assert step["subtask"][row].item() == 1 and step["completed"][row].item() == 1
    following = make(4, subtask=1, seed=5)
    start = step["snapshot"][[row] * 4]
    use = torch.tensor([[True], [False], [True], [False]])
    injected = following.reset(TensorDict({"start": {"snapshot": start, "use": use}}, [4]))
    assert torch.equal(injected["observation"][0], step["observation"][row])
    assert torch.equal(injected["observation"][0], injected["observation"][2])
    assert not torch.equal(injected["observation"][1], injected["observation"][3])
    assert (
        injected["subtask"].eq(1).all() and not injected["completed"].any() and not injected["success"].any()
    )
    assert not following.world.state["episode_step"].any()
    rows = [following.step(still(following))["next"]["observation"] for _ in range(5)]
    assert all(torch.equal(row[0], row[2]) and not torch.equal(row[0], row[1]) for row in rows)


def test_only_resetting_rows_take_an_injected_start():
    env = make(3, subtask=1)
    start = env.reset()["observation"]
    snapshot = env.snapshot()
    moved = [env.step(still(env))["next"]["observation"] for _ in range(2)][-1]
    which = torch.tensor([[True], [False], [False]])
    td = TensorDict({"_reset": which, "start": {"snapshot": snapshot, "use": torch.ones(3, 1).bool()}}, [3])
    assert torch.equal(env.reset(td)["observation"][0], start[0])
    assert torch.equal(env.world.observation().float()[1:], moved[1:])
    assert not torch.equal(moved[1:], start[1:])


def test_an_injected_start_counts_once():
    """In TorchRL's loop by hand one TensorDict goes from reset to step and back."""
    env = make(2, subtask=1)
    first = env.reset()["observation"]
    start = {"snapshot": env.snapshot(), "use": torch.ones(2, 1, dtype=torch.bool)}
    tensordict = env.reset(TensorDict({"start": start}, [2]))
    assert torch.equal(tensordict["observation"], first)
    tensordict = env.step_mdp(env.step(tensordict.update(still(env))))
    assert not torch.equal(env.reset(tensordict)["observation"], first)


def test_an_injected_start_begins_a_new_episode_or_goes_on_with_its_own():
    env = make(2, max_steps=20)
    tensordict, expert = env.reset(), env.expert()
    for _ in range(12):
        tensordict = env.step_mdp(env.step(expert(tensordict)))
    before, snapshot = tensordict.clone(), env.snapshot()
    assert (before["phase"] > 1).all()
    every = torch.ones(2, 1, dtype=torch.bool)
    goes_on = torch.tensor([[True], [False]])
    start = TensorDict({"snapshot": snapshot, "use": every, "goes_on": goes_on}, [2])
    tensordict = env.reset(TensorDict({"start": start}, [2]))
    torch.testing.assert_close(tensordict["observation"][0], before["observation"][0])
    assert tensordict["phase"].flatten().tolist() == [int(before["phase"][0]), 1]
    ends = torch.zeros(2, dtype=torch.int64)
    for step in range(1, 21):
        truncated = env.step(still(env))["next", "truncated"].flatten()
        ends[(ends == 0) & truncated] = step
    assert ends.tolist() == [8, 20], "the time limit of an episode that goes on is what its own has left"


def test_what_has_no_episode_cannot_go_on():
    env = make(2)
    waiting = env.snapshot()
    env.reset()
    given_up = env.snapshot()
    given_up["task", "failed"][1] = True
    every = torch.ones(2, 1, dtype=torch.bool)
    for snapshot, why in (
        (waiting, "simulation 0: that one had not begun"),
        (given_up, "simulation 1: .* given up"),
    ):
        start = TensorDict({"snapshot": snapshot, "use": every, "goes_on": every}, [2])
        with pytest.raises(
            ValueError, match=f"no episode of table_lack can start from the snapshot in {why}"
        ):
            env.reset(TensorDict({"start": start}, [2]))


def test_the_expert_can_start_anywhere_and_finishes_from_as_met():
    step = until_success(make(4, snapshots=True))["next"]
    row = int(step["success"].flatten().nonzero()[0])
    env = make(4, subtask=1)
    tensordict = env.reset(
        TensorDict({"start": {"snapshot": step["snapshot"][[row] * 4], "use": torch.ones(4, 1).bool()}}, [4])
    )
    expert, success = env.expert(), torch.zeros(4, 1, dtype=torch.bool)
    for _ in range(env.max_steps):
        tensordict = env.step(expert(tensordict))
        success |= tensordict["next", "success"]
        tensordict = env.step_mdp(tensordict)
        if success.all():
            break
    assert success.all()


def test_an_injected_start_of_another_subtask_changes_nothing():
    env, other = make(), make(subtask=1)
    before = env.reset()["observation"]
    other.reset()
    for use in ([[True]] * 3, [[True], [False], [True]]):
        start = {"snapshot": other.snapshot(), "use": torch.tensor(use)}
        with pytest.raises(
            ValueError, match="subtask 0 of table_lack cannot start from snapshots of subtask 1"
        ):
            env.reset(TensorDict({"start": start}, [3]))
        assert torch.equal(env.world.observation().float(), before)


def test_of_a_refused_batch_no_row_starts():
    """Neither the row that begins, nor the ones whose episodes go on."""
    env, other = make(), make(subtask=1)
    for each in (env, other):
        each.reset()
    snapshot = torch.cat([env.snapshot()[:2], other.snapshot()[2:]])
    env.step(still(env))
    before = env.snapshot()
    every, goes_on = torch.ones(3, 1).bool(), torch.tensor([[False], [True], [True]])
    start = {"snapshot": snapshot, "use": every, "goes_on": goes_on}
    with pytest.raises(ValueError, match="never come to where the snapshot in simulation 2 is, at subtask 1"):
        env.reset(TensorDict({"start": start}, [3]))
    assert all(torch.equal(value, before[key]) for key, value in env.snapshot().items(True, True))


def test_through_transforms_only_skill_chain_reset_injects_a_start():
    env = make(subtask=1, snapshots=True)
    taken = env.reset().select("observation", "snapshot")[:1]
    injected = {"snapshot": taken["snapshot"][[0] * 3], "use": torch.ones(3, 1).bool()}
    given = with_starts(make(subtask=1, seed=5)).reset(TensorDict({"start": injected}, [3]))
    assert not (given["observation"] == taken["observation"]).all(-1).any()
    states = TerminationSet(1)
    states.extend(taken)
    chained = with_starts(make(subtask=1, seed=5), states, probability=1.0).reset()
    assert (chained["observation"] == taken["observation"]).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"use": None}, "an injected start needs 'snapshot' and 'use', got no use"),
        ({"snapshot": None}, "an injected start needs 'snapshot' and 'use', got no snapshot"),
        ({"use": torch.ones(3, 1)}, r"'start.use' is bool, \(3, 1\), got torch.float32, \(3, 1\)"),
        (
            {"goes_on": torch.ones(3, 2).bool()},
            r"'start.goes_on' is bool, \(3, 1\), got torch.bool, \(3, 2\)",
        ),
    ],
)
def test_a_start_that_says_too_little_is_refused(change, message):
    env = make()
    env.reset()
    start = {"snapshot": env.snapshot(), "use": torch.ones(3, 1).bool(), **change}
    given = {name: value for name, value in start.items() if value is not None}
    with pytest.raises(ValueError, match=message):
        env.reset(TensorDict({"start": given}, [3]))


def test_a_finished_table_is_no_start():
    env = make(subtask=None)
    env.reset()
    everywhere = torch.ones(3, dtype=torch.bool)
    for step in range(4):
        env.world.task.connect_ideally(step, everywhere)
        env.world.task.starts.weld(step, everywhere)
    finished = env.snapshot()
    finished["task", "subtask"] = torch.full_like(finished["task", "subtask"], 4)
    with pytest.raises(
        ValueError, match="the whole task of table_lack cannot start from snapshots of subtask 4"
    ):
        env.reset(TensorDict({"start": {"snapshot": finished, "use": torch.ones(3, 1).bool()}}, [3]))
