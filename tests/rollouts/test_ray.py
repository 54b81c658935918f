"""Rollouts and recipes on a Ray cluster of two workers on this machine: what is the same, and what a death does."""

import itertools
import os
import signal
import sys
import threading
import time
from contextlib import suppress
from functools import partial
from pathlib import Path

import pandas as pd
import pytest
import torch
from recipe_runs import SMALL, metrics, places, run

from tstar_rl import FurnitureEnv
from tstar_rl.chaining.skill import Skill
from tstar_rl.launch.cluster import run_on_cluster
from tstar_rl.models.network_settings import NetworkSettings
from tstar_rl.rollouts.cluster import ClusterSettings, connect
from tstar_rl.rollouts.collection import Collection, with_starts
from tstar_rl.rollouts.ray_collection import RayCollection, Worker, _make
from tstar_rl.rollouts.starts import make_starts
from tstar_rl.rollouts.state_sets import TerminationSet
from tstar_rl.updates import PolicyUpdate, PPOSettings

CLUSTER = ClusterSettings()


def make_environment(num_envs: int, seed: int, before: TerminationSet | None = None):
    """Episodes of six steps; those of a set begin there, all of them."""
    env = FurnitureEnv("table_lack", num_envs, 0, 1, seed=seed, snapshots=before is not None, max_steps=6)
    if before is None:
        return with_starts(env)
    return with_starts(env, *make_starts({"buffer": 1.0}, env, before), seed)


def new_skill() -> Skill:
    torch.manual_seed(0)
    return Skill("table_lack", 0, NetworkSettings(hidden=(16,), std="fixed"))


def test_without_ray_the_command_that_installs_it_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ImportError, match=r"collection.backend=ray .* pip install -e '\.\[ray\]'"):
        RayCollection(make_environment, new_skill().policy, 4, 8, 2, seed=0)


def test_simulations_that_cannot_be_shared_out_are_refused():
    with pytest.raises(
        ValueError, match=r"training.num_envs must be a multiple of collection.workers, got 5 .* 2"
    ):
        RayCollection(make_environment, new_skill().policy, 5, 8, 2, seed=0)


def test_a_worker_whose_starts_are_not_sent_keeps_those_that_it_has():
    """As in the training of one skill from a set of a recipe's own, which does not change."""
    policy, before = new_skill().policy, TerminationSet(4)
    env = FurnitureEnv("table_lack", 2, 0, 1, seed=0, snapshots=True, max_steps=6)
    before.extend(env.reset().select("observation", "snapshot"))
    worker = Worker(make_environment(2, 0, before), policy, frames_per_batch=8, total_frames=-1)
    assert worker.collect(policy.state_dict(), None, 0).batch_size == (2, 4) and len(before) == 2


@pytest.fixture(scope="module")
def cluster():
    """Two workers' room on this machine, gone after these tests."""
    pytest.importorskip("ray", reason="Ray is not installed: pip install -e '.[ray]'")
    ray = connect(CLUSTER, 2)
    ray.cloudpickle.register_pickle_by_value(sys.modules[__name__])  # workers cannot import a test
    yield ray
    ray.shutdown()


@pytest.fixture
def collect(cluster):
    """Makes a RayCollection of four simulations and eight steps, and ends its workers."""
    made = []

    def make(skill: Skill, before: TerminationSet | None = None, seed: int = 0) -> RayCollection:
        made.append(RayCollection(make_environment, skill.policy, 4, 8, 2, seed, before, CLUSTER))
        return made[-1]

    yield make
    for each in made:
        each.close()


def process(worker) -> int:
    import ray

    return ray.get(worker.__ray_call__.remote(lambda self: os.getpid()))


@pytest.mark.slow
def test_rollouts_are_like_those_of_this_process_and_of_the_policy_as_it_is(collect):
    skill = new_skill()
    collection = collect(skill)
    local = Collection(make_environment(4, 0), skill.policy, 8).rollout()
    rollout = collection.rollout()
    keys = sorted(local.keys(True, True), key=str)
    assert sorted(rollout.keys(True, True), key=str) == keys and rollout.batch_size == local.batch_size
    for key in keys:
        assert rollout[key].shape == local[key].shape and rollout[key].dtype == local[key].dtype, key

    skill.normalizer.fit(rollout["observation"])
    update = PolicyUpdate(skill.policy, skill.value, PPOSettings(minibatch=16), skill.return_scale)
    before = skill.policy(rollout.clone())["loc"]
    update(rollout.set(("next", "reward"), rollout["next", "reward_env"]))
    after = collection.rollout()
    torch.testing.assert_close(after["loc"], skill.policy(after.clone())["loc"], rtol=1e-5, atol=1e-6)
    assert not torch.allclose(before, skill.policy(rollout.clone())["loc"])


@pytest.mark.slow
def test_rollouts_go_on_bit_for_bit_from_their_state(collect):
    first = collect(new_skill())
    first.rollout()
    first.settle()
    state = first.state_dict()
    expected = first.rollout()
    first.close()  # the cluster has room for two workers
    second = collect(new_skill())
    second.load_state_dict(state)
    resumed = second.rollout()
    for key in ("observation", "action", ("next", "reward_env"), ("next", "done"), "start_observation"):
        assert torch.equal(expected[key], resumed[key]), key


@pytest.mark.slow
def test_every_worker_and_every_run_draws_starts_and_actions_of_its_own(collect):
    rollouts = []
    for seed in (0, 1):
        collection = collect(new_skill(), seed=seed)
        rollouts += collection.rollout().split(2)
        collection.close()  # the cluster has room for two workers
    for one, other in itertools.combinations(rollouts, 2):
        assert not torch.equal(one["observation"][:, 0], other["observation"][:, 0])
        noise = [(each["action"] - each["loc"])[:, 0] for each in (one, other)]
        assert not torch.allclose(*noise, atol=1e-4)


@pytest.mark.slow
def test_starts_are_those_of_the_set_as_it_is(collect):
    env = FurnitureEnv("table_lack", 4, 0, 1, seed=5, snapshots=True)
    before = TerminationSet(16)
    collection = collect(new_skill(), before)
    collection.rollout()  # episodes of six steps: it ends in the second ones, none from the empty set
    before.extend(env.rollout(3, break_when_any_done=False)[:, -1].select("observation", "snapshot"))
    known = before.all()["observation"]
    rollout = collection.rollout()
    began = rollout["start_observation"][:, -1]
    assert rollout["step_count"][:, -1].max() < 6
    distance = torch.cdist(began[:, 29:64].double(), known[:, 29:64].double()).amin(1)
    assert float(distance.max()) < 1e-3, "an episode began elsewhere than in the set"


def test_a_workers_first_starts_are_those_of_the_set_too():
    """A collector resets its simulations when it is made, before the first rollout brings the set."""
    env = FurnitureEnv("table_lack", 4, 0, 1, seed=5, snapshots=True)
    before = TerminationSet(16)
    before.extend(env.rollout(1)[:, -1].select("observation", "snapshot"))
    starts = _make(lambda num_envs, seed, states: states, 2, 0, before.capacity, before.state_dict())
    assert torch.equal(starts.all()["observation"], before.all()["observation"]) and len(starts) == 4
    assert _make(lambda num_envs, seed, states: states, 2, 0, None, None) is None


@pytest.mark.slow
def test_failures_of_all_workers_are_counted_together(collect):
    import ray

    collection = collect(new_skill())
    assert collection.counts() == {}
    for number, worker in enumerate(collection.collector.remote_collectors, 1):
        ray.get(worker.__ray_call__.remote(partial(lose, number)))
    assert collection.counts() == {"failures": 3}


def lose(number: int, worker: Worker) -> None:
    worker.env.base_env.world.failures += number


@pytest.mark.slow
def test_a_worker_killed_in_the_middle_is_replaced(collect):
    collection = collect(new_skill())
    collection.rollout()
    worker = collection.collector.remote_collectors[1]
    was = process(worker)
    killer = threading.Timer(0.02, partial(os.kill, was, signal.SIGKILL))
    killer.start()
    rollouts = [collection.rollout() for _ in range(3)]
    killer.join()
    assert process(worker) != was
    last = rollouts[-1]
    assert last.batch_size == (4, 8) and all(
        bool(value.isfinite().all()) for value in last.values(True, True)
    )


@pytest.mark.slow
def test_a_recipe_whose_worker_is_killed_goes_on_elsewhere(cluster, demonstrations, tmp_path):
    """What `launch=ray` does with a step: the step's process is the worker's, and its checkpoint survives it."""
    values = [*SMALL, demonstrations, *places(tmp_path, "a")]
    run_on_cluster(
        CLUSTER, 2, ("gail_ppo", "subtask=0"), [*SMALL, demonstrations, *places(tmp_path, "whole")]
    )
    file = metrics(tmp_path, "a")
    running = threading.Thread(target=run_on_cluster, args=(CLUSTER, 2, ("gail_ppo", "subtask=0"), values))
    running.start()
    while running.is_alive() and not (file.is_file() and len(file.read_text().splitlines()) > 4):
        time.sleep(0.02)
    os.kill(_process_of("gail_ppo", tmp_path), signal.SIGKILL)
    running.join()
    assert file.read_bytes() == metrics(tmp_path, "whole").read_bytes()


@pytest.mark.slow
def test_a_recipe_that_fails_on_the_cluster_is_named(cluster, tmp_path):
    step = ("gail_ppo", "subtask=0", f"demonstrations_dir={tmp_path}")
    with pytest.raises(SystemExit, match=r"(?s)this step failed .*gail_ppo.py .*subtask=0"):
        run_on_cluster(CLUSTER, 2, step, [*SMALL, *places(tmp_path, "a")])


@pytest.mark.slow
def test_the_same_recipe_collects_on_a_cluster(demonstrations, tmp_path):
    pytest.importorskip("ray", reason="Ray is not installed: pip install -e '.[ray]'")
    done = run("gail_ppo", "subtask=0", "collection.backend=ray", demonstrations, *places(tmp_path, "a"))
    assert done.returncode == 0, done.stderr
    table = pd.read_csv(metrics(tmp_path, "a"))
    assert table.env_steps.iloc[-1] == 1024 and table.kl.notna().all()


def _process_of(name: str, folder: Path) -> int:
    """The worker that runs the task of that name (Ray writes it into the process's title) on files below a folder."""
    for process in filter(str.isdigit, os.listdir("/proc")):
        place = Path("/proc", process)
        with suppress(OSError):  # it has ended, or is another user's
            if place.joinpath("cmdline").read_bytes().startswith(f"ray::{name}".encode()):
                opened = [os.readlink(each) for each in place.joinpath("fd").iterdir()]
                if any(file.startswith(f"{folder}/") for file in opened):
                    return int(process)
    raise AssertionError(f"no worker runs {name} on {folder}")
