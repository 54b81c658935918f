"""The TorchRL front: specs, resets, injected starts, ends, seeds, resuming."""

import pytest
import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.envs import check_env_specs

from tstar_rl.env.furniture_env import FurnitureEnv
from tstar_rl.rollouts.collection import counts_of, with_starts

KEYS = ("observation", "subtask", "phase", "success", "completed", "done", "terminated", "truncated")


def make(num_envs: int = 3, **arguments) -> FurnitureEnv:
    return FurnitureEnv("table_lack", num_envs, **{"subtask": 0, "nthread": 1, "seed": 0, **arguments})


def still(env: FurnitureEnv) -> TensorDict:
    action = torch.zeros(env.num_envs, 9)
    action[:, 7:] = -1
    return TensorDict({"action": action}, env.batch_size)


def same(a: TensorDictBase, b: TensorDictBase, rows=slice(None), keys=KEYS) -> bool:
    return all(torch.equal(a[key][rows], b[key][rows]) for key in keys)


def until_success(env: FurnitureEnv) -> TensorDict:
    """Runs the expert until a simulation succeeds; that step."""
    tensordict, expert = env.reset(), env.expert()
    for _ in range(env.max_steps):
        tensordict = env.step(expert(tensordict))
        if tensordict["next", "success"].any():
            return tensordict
        tensordict = env.step_mdp(tensordict)
    raise AssertionError("the expert did not succeed")


@pytest.mark.parametrize("snapshots", [False, True])
@pytest.mark.parametrize("subtask", [1, None])
def test_specs(snapshots, subtask):
    env = make(2, snapshots=snapshots, subtask=subtask)
    check_env_specs(env, seed=0)
    assert ("snapshot" in env.observation_spec.keys()) is snapshots
    assert env.reward_key == "reward_env" and env.batch_size == torch.Size([2])


def test_a_partial_reset_leaves_the_others_untouched():
    env, twin = make(), make()
    rows, moved = [0, 2], torch.tensor([[False], [True], [False]])
    for each in (env, twin):
        each.reset()
        for _ in range(3):
            each.step(still(each))
    reset = env.reset(TensorDict({"_reset": moved}, env.batch_size))
    for _ in range(5):
        after, wanted = env.step(still(env))["next"], twin.step(still(twin))["next"]
        assert same(after, wanted, rows, (*KEYS, "reward_env"))
        assert not torch.equal(after["observation"][1], wanted["observation"][1])
    assert reset["phase"][1].item() == 1 and not reset["done"].any()
    assert env.world.state["episode_step"].tolist() == [8, 5, 8]


def test_what_was_returned_does_not_change_later():
    env = make(snapshots=True)
    outs = [env.reset(), env.step(still(env))["next"]]
    copies = [out.clone() for out in outs]
    outs[1]["subtask"] += 0  # writes in place
    twin = make(snapshots=True)
    twin.reset()
    twin.step(still(twin))
    for value in outs[1].flatten_keys().values():
        value.copy_(torch.zeros_like(value))  # what a user does to a row is not the simulation's business
    assert same(env.step(still(env))["next"], twin.step(still(twin))["next"], keys=(*KEYS, "reward_env"))
    env.reset()
    assert all(torch.equal(value, copies[0][key]) for key, value in outs[0].items(True, True))


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


def test_noise_moves_the_action_but_not_the_label():
    env = make()
    tensordict = env.expert(noise=0.2, generator=torch.Generator().manual_seed(0))(env.reset())
    clean = env.expert()(env.reset(seed=0))
    assert torch.equal(clean["action"], clean["expert_action"])
    off = (tensordict["action"] - tensordict["expert_action"]).abs()
    assert off[:, :7].max() > 0.05 and not off[:, 7:].any() and tensordict["action"].abs().max() <= 1


def test_a_time_limit_truncates():
    env = make(max_steps=4)
    env.reset()
    steps = [env.step(still(env))["next"] for _ in range(4)]
    assert not any(step["done"].any() for step in steps[:3])
    assert steps[3]["truncated"].all() and steps[3]["done"].all() and not steps[3]["terminated"].any()


def test_a_lost_simulation_terminates(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    env = make()
    env.reset()
    assert counts_of(with_starts(env)) == {}
    env.world.physics.qvel[1, 0] = float("nan")
    step = env.step(still(env))["next"]
    assert step["terminated"].flatten().tolist() == [False, True, False] and not step["truncated"].any()
    assert not step["success"].any() and env.failures == 1 and step["observation"].isfinite().all()
    assert counts_of(with_starts(env)) == {"failures": 1}  # what recipes log


def test_the_whole_task_counts_what_it_completed():
    env = make(2, subtask=None)
    tensordict, expert = env.reset(), env.expert()
    assert not tensordict["completed"].any() and env.max_steps == 800
    done = torch.zeros(2, 1, dtype=torch.bool)
    for _ in range(env.max_steps):
        step = env.step(expert(tensordict))
        before, after = step["completed"], step["next", "completed"]
        assert ((after - before == 0) | (after - before == 1)).all()
        assert torch.equal(step["next", "subtask"], after)
        assert torch.equal(step["next", "success"] & ~done, (after == 4) & (before == 3) & ~done)
        done |= step["next", "done"]
        if done.any():
            break
        tensordict = env.step_mdp(step)
    assert step["next", "success"].any()


def test_preassembled_subtasks_are_not_counted():
    step = until_success(make(2, subtask=2))["next"]
    assert step["completed"][step["success"]].eq(1).all() and step["subtask"][step["success"]].eq(3).all()


def test_seeds_reproduce():
    first, again, other = (make(seed=seed).rollout(4)["observation"] for seed in (3, 3, 4))
    torch.manual_seed(0)
    a = make(seed=3).reset()["observation"]
    torch.manual_seed(1)
    b = make(seed=3).reset()["observation"]
    assert torch.equal(a, b) and torch.equal(first[:, 0], again[:, 0]) and torch.equal(first[:, 0], a)
    assert not torch.equal(first[:, 0], other[:, 0])
    env = make(seed=3)
    env.reset()
    env.set_seed(3)
    assert torch.equal(env.reset()["observation"], a)


def test_a_loaded_state_goes_on_bit_for_bit():
    env, resumed = make(snapshots=True), make(seed=77, snapshots=True)
    tensordict, expert = env.reset(), env.expert()
    for _ in range(15):
        tensordict = env.step_mdp(env.step(expert(tensordict)))
    state = env.state_dict()
    env.load_state_dict(state)
    resumed.load_state_dict(state)
    for _ in range(15):
        action = expert(tensordict)["action"].clone()
        ours, theirs = (each.step(TensorDict({"action": action}, [3]))["next"] for each in (env, resumed))
        assert same(ours, theirs, keys=(*KEYS, "reward_env"))
        tensordict = ours
    assert same(env.reset(), resumed.reset())  # the generators too


def test_arguments_build_the_environment_again():
    env = make(subtask=2, velocity_scale=0.4, preassembled="jitter")
    again = FurnitureEnv(num_envs=3, nthread=1, seed=0, **env.arguments)
    assert again.arguments == env.arguments and torch.equal(
        env.reset()["observation"], again.reset()["observation"]
    )


def test_an_injected_start_of_another_subtask_changes_nothing():
    env, other = make(), make(subtask=1)
    before = env.reset()["observation"]
    other.reset()
    start = {"snapshot": other.snapshot(), "use": torch.ones(3, 1).bool()}
    with pytest.raises(ValueError, match="subtask 0 of table_lack cannot start from snapshots of subtask 1"):
        env.reset(TensorDict({"start": start}, [3]))
    assert torch.equal(env.world.observation().float(), before)


def test_a_finished_table_is_no_start():
    env = make(subtask=None)
    env.reset()
    finished = env.snapshot()
    finished["task", "subtask"] = torch.full_like(finished["task", "subtask"], 4)
    with pytest.raises(
        ValueError, match="the whole task of table_lack cannot start from snapshots of subtask 4"
    ):
        env.reset(TensorDict({"start": {"snapshot": finished, "use": torch.ones(3, 1).bool()}}, [3]))
