"""One simulation in an MjData of somebody else's: the same bits as a row of MuJoCo's batch."""

import mujoco
import pytest
import torch

import tstar_envs
from tstar_envs.environment import BatchedEnvironment
from tstar_envs.furniture import load
from tstar_envs.physics.single import SinglePhysics
from tstar_envs.scene import build_model


def pair(name: str, subtask: int | None = None, **settings) -> tuple[BatchedEnvironment, BatchedEnvironment]:
    """The batch with one simulation, and one in an MjData."""
    model = build_model(load(name))
    view = SinglePhysics(model, mujoco.MjData(model))
    single = BatchedEnvironment(name, 1, subtask, seed=0, settings=settings, physics=view)
    worlds = tstar_envs.load(name, 1, subtask, 1, 0, **settings), single
    for world in worlds:
        world.reset()
    return worlds


def test_a_view_of_another_number_of_simulations_is_refused():
    model = build_model(load("table_lack"))
    with pytest.raises(ValueError, match="physics has 1 simulations, and num_sims is 3"):
        BatchedEnvironment("table_lack", 3, physics=SinglePhysics(model, mujoco.MjData(model)))


def same(one: BatchedEnvironment, other: BatchedEnvironment) -> bool:
    snapshots = one.snapshot(), other.snapshot()
    return torch.equal(one.observation(), other.observation()) and all(
        torch.equal(value, snapshots[1][name]) for name, value in snapshots[0].items(True, True)
    )


@pytest.mark.parametrize(
    ("name", "settings"), [("table_lack", {}), ("chair_ingolf", {"subtask": 2, "preassembled": "jitter"})]
)
def test_the_same_bits_through_grasps_connections_sleep_and_restores(name, settings):
    batch, single = pair(name, **settings)
    assert same(batch, single)
    expert, generator = batch.expert(), torch.Generator().manual_seed(0)
    idle = torch.tensor([[0.0] * 7 + [-1.0, -1.0]], dtype=torch.float64)
    kept = None
    for step in range(170):
        action = expert.act(batch.state) if step % 60 < 50 else idle  # parts fall asleep meanwhile
        if step % 7 == 0:
            action[:, :7] += 0.2 * torch.randn(1, 7, dtype=torch.float64, generator=generator)
        for world in (batch, single):
            world.step(action)
        assert same(batch, single), step
        if step == 40:
            kept = single.snapshot()
        if step == 80:
            for world in (batch, single):
                world.restore(kept)
            assert same(batch, single)
    assert batch.state["completed"] >= 1


def test_a_simulation_that_fails_ends_and_starts_again_alike(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log there
    batch, single = pair("table_lack", 0)
    for value in (float("nan"), 1e12):
        for world in (batch, single):
            world.physics.qvel[0, 3] = value
            world.step(torch.zeros(1, 9))
            assert world.state["failed"].all() and world.observation().isfinite().all()
        assert same(batch, single) and batch.failures == single.failures
        for world in (batch, single):
            world.reset()
        assert same(batch, single)


def test_what_is_written_into_the_mjdata_counts_like_what_is_written_into_the_row():
    (_, one), (_, other) = pair("table_lack", 0), pair("table_lack", 0)
    one.physics.qpos[0, 30] += 0.05
    other.physics.data.qpos[30] += 0.05
    for world in (one, other):
        world.step(torch.zeros(1, 9))
    assert same(one, other)
    before = one.snapshot()
    one.step(torch.ones(1, 9), torch.zeros(1, dtype=torch.bool))
    assert torch.equal(one.snapshot()["physics"], before["physics"])
