"""The TorchRL front: specs, resets, ends, seeds, resuming."""

from itertools import count

import pytest
import torch
from table_envs import KEYS, make, same, still, until_success
from tensordict import TensorDict
from tensordict.nn import TensorDictModule
from torchrl.collectors import Collector
from torchrl.envs import EnvCreator, SerialEnv, check_env_specs

from tstar_rl.env.furniture_env import FurnitureEnv
from tstar_rl.rollouts.collection import counts_of, with_starts


@pytest.mark.parametrize("snapshots", [False, True])
@pytest.mark.parametrize("subtask", [1, None])
def test_specs(snapshots, subtask):
    env = make(2, snapshots=snapshots, subtask=subtask)
    check_env_specs(env, seed=0)
    assert ("snapshot" in env.observation_spec.keys()) is snapshots
    assert env.reward_key == "reward_env" and env.batch_size == torch.Size([2])
    one = env.observation_spec[0]  # of one simulation
    assert one.shape == () and one["observation"].shape == env.observation_spec["observation"].shape[1:]


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


def test_a_partial_reset_says_of_the_others_that_they_have_ended():
    env = make(max_steps=3)
    env.reset()
    for _ in range(3):
        ended = env.step(still(env))["next"]
    assert ended["truncated"].all()
    which = TensorDict({"_reset": torch.tensor([[False], [True], [False]])}, env.batch_size)
    with pytest.warns(UserWarning, match="partial"):  # TorchRL sees from our flags that the others had ended
        reset = env.reset(which)
    assert reset["truncated"].flatten().tolist() == reset["done"].flatten().tolist() == [True, False, True]
    assert not reset["terminated"].any()


def test_a_reset_may_be_seeded():
    env = make(seed=1)
    first = env.reset(seed=3)["observation"]
    other = env.reset()["observation"]
    assert torch.equal(env.reset(seed=3)["observation"], first) and not torch.equal(other, first)
    assert torch.equal(with_starts(make(seed=2)).reset(seed=3)["observation"], first)
    with pytest.raises(TypeError, match=r"reset\(\) got an unexpected keyword argument 'sede'; valid: seed"):
        env.reset(sede=3)


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


def test_noise_moves_the_action_but_not_the_label():
    env = make()
    tensordict = env.expert(noise=0.2, generator=torch.Generator().manual_seed(0))(env.reset())
    drawn = torch.get_rng_state()
    clean = env.expert()(env.reset(seed=0))
    assert torch.equal(torch.get_rng_state(), drawn), "without noise nothing is drawn"
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


def test_torchrls_factories_share_nothing_of_an_environment():
    """`EnvCreator` hands what the first environment's transforms know to all others; each keeps its own episodes."""
    seeds = count()
    both = SerialEnv(2, EnvCreator(lambda: make(seed=next(seeds)), share_memory=False))
    first, second = both.reset()["observation"]
    assert not torch.equal(first, second)
    SerialEnv(2, EnvCreator(lambda: make(seed=3))).rollout(2)  # in shared memory, as `ParallelEnv` has it


def test_the_checkpoint_of_a_collector_of_a_bare_environment_can_be_loaded():
    policy = TensorDictModule(torch.nn.LazyLinear(9), ["observation"], ["action"])
    policy(make().reset())  # its size
    collector = Collector(make, policy, frames_per_batch=6, total_frames=6)
    collector.load_state_dict(collector.state_dict())
    collector.shutdown()


def test_a_state_that_lacks_a_part_is_named():
    env = make()
    state = env.state_dict()
    del state["generator"]
    with pytest.raises(ValueError, match="has generator, snapshot and failures, got no generator"):
        env.load_state_dict(state)


def test_a_state_that_is_refused_changes_nothing():
    env, other = make(), make(subtask=1)
    env.reset()
    other.reset()
    before = env.state_dict()
    with pytest.raises(ValueError, match="subtask"):
        env.load_state_dict(other.state_dict())
    after = env.state_dict()
    assert torch.equal(after["generator"], before["generator"])
    assert torch.equal(after["snapshot"]["physics"], before["snapshot"]["physics"])


def test_specs_have_the_types_of_what_is_returned_whatever_torchs_default_is():
    torch.set_default_dtype(torch.float64)
    try:
        check_env_specs(make())
    finally:
        torch.set_default_dtype(torch.float32)


def test_arguments_build_the_environment_again():
    env = make(subtask=2, velocity_scale=0.4, preassembled="jitter")
    again = FurnitureEnv(num_envs=3, nthread=1, seed=0, **env.arguments)
    assert again.arguments == env.arguments and torch.equal(
        env.reset()["observation"], again.reset()["observation"]
    )
