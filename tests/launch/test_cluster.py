"""Connecting to a cluster, and recipes that run on one, with a stand-in for Ray that any machine can run."""

import threading
import time
from types import SimpleNamespace

import pytest
from hydra import compose, initialize_config_dir

from tstar_rl.config.values import CONFIGS
from tstar_rl.launch.backends import launcher
from tstar_rl.launch.children import end_children
from tstar_rl.launch.cluster import run_on_cluster
from tstar_rl.rollouts.cluster import ClusterSettings, connect

CLUSTER = ClusterSettings()


class StandIn:
    """As much of the module `ray` as connecting and running a recipe needs: whatever it is asked takes a while."""

    exceptions = SimpleNamespace(RayError=RuntimeError)

    def __init__(self):
        self.inits, self.cancelled, self.begun = [], threading.Event(), threading.Event()

    def is_initialized(self):
        return bool(self.inits)

    def init(self, **values):
        time.sleep(0.2)
        self.inits.append(values)

    def remote(self, **_):
        task = SimpleNamespace(remote=lambda *arguments: "task")
        return lambda function: SimpleNamespace(options=lambda name: task)

    def get(self, task):
        self.begun.set()
        if self.cancelled.wait(20):
            raise RuntimeError("it was cancelled")

    def cancel(self, task, force):
        assert (task, force) == ("task", True)
        self.cancelled.set()


@pytest.fixture
def stand_in(monkeypatch):
    ray = StandIn()
    monkeypatch.setattr("tstar_rl.rollouts.cluster.import_extra", lambda *arguments: ray)
    return ray


def test_lanes_that_begin_at_once_connect_once(stand_in):
    lanes = [threading.Thread(target=connect, args=(CLUSTER, 3)) for _ in range(4)]
    for lane in lanes:
        lane.start()
    for lane in lanes:
        lane.join()
    assert len(stand_in.inits) == 1 and stand_in.inits[0]["num_cpus"] >= 3


def test_a_cluster_of_ones_own_has_room_for_the_workers_of_each_recipe(stand_in):
    values = ["launch=ray", "collection.backend=ray", "collection.workers=7", "processes=9"]
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        run = launcher(compose("recipe/assemble", values))
    stand_in.cancelled.set()
    with pytest.raises(SystemExit, match="this step failed: .*plot.py"):
        run(("plot",))
    assert stand_in.inits[0]["num_cpus"] == 72


def test_a_recipe_on_a_cluster_is_cancelled_with_the_rest(stand_in):
    said = []

    def lane():
        try:
            run_on_cluster(CLUSTER, 1, ("plot",))
        except SystemExit as stop:
            said.append(str(stop))

    running = threading.Thread(target=lane)
    running.start()
    assert stand_in.begun.wait(20)
    end_children()
    running.join(10)
    assert not running.is_alive() and said[0].endswith("it was cancelled")
