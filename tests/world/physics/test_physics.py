"""Snapshots, threads and failures: what has to hold to the bit."""

import pytest
import torch
from torch import Tensor

import tstar_envs
from tstar_envs.environment import BatchedEnvironment

IDLE = torch.tensor([0.0] * 7 + [-1.0, -1.0], dtype=torch.float64)


def make(num_sims: int = 3, seed: int = 0, nthread: int = 1, subtask: int | None = 1) -> BatchedEnvironment:
    world = tstar_envs.load("table_lack", num_sims, subtask, nthread, seed)
    world.reset()
    return world


def idle(world: BatchedEnvironment) -> Tensor:
    return IDLE.repeat(world.num_sims, 1)


def follow(world: BatchedEnvironment, actions: list[Tensor]) -> list[Tensor]:
    """Everything outward of each step."""
    rows = []
    for action in actions:
        world.step(action)
        rows.append(torch.cat([world.observation(), world.state["reward"].unsqueeze(-1)], dim=-1))
    return rows


def expert_actions(world: BatchedEnvironment, steps: int) -> list[Tensor]:
    expert, actions = world.expert(), []
    for _ in range(steps):
        actions.append(expert.act(world.state))
        world.step(actions[-1])
    return actions


def asleep(world: BatchedEnvironment) -> Tensor:
    """(N, trees) bool: MuJoCo counts up to -1 while a tree is awake."""
    return torch.from_numpy(world.physics.batch.bind("tree_asleep")).clone() >= 0


def to_grasp(world: BatchedEnvironment) -> None:
    expert = world.expert()
    for _ in range(60):
        if bool((world.state["phase"] >= 5).all()):
            break
        world.step(expert.act(world.state))


def test_restores_agree_with_a_weld_active_and_a_part_in_the_hand():
    world = make()
    to_grasp(world)
    scene = world.task.scene(world.state)
    assert scene.touching.all() and (world.physics.eq_active[:, 0] == 1).all()
    snapshot, observation = world.snapshot(), world.observation()
    actions = expert_actions(world, 12)

    world.restore(snapshot)
    assert torch.equal(world.observation(), observation)
    assert torch.equal(world.task.scene(world.state).touching, scene.touching)
    first = follow(world, actions)
    world.restore(snapshot)
    second = follow(world, actions)
    other = make(seed=9)  # other draws, other history
    other.restore(snapshot)
    third = follow(other, actions)
    assert all(map(torch.equal, first, second)) and all(map(torch.equal, first, third))
    assert not torch.equal(first[0], first[-1])


def test_restores_agree_when_parts_sleep():
    world = make()
    assert not asleep(world)[:, 1:].all()
    follow(world, [idle(world)] * 20)
    assert asleep(world)[:, 1:].all() and not asleep(world)[:, 0].any()  # all but the arm
    snapshot = world.snapshot()
    actions = expert_actions(world, 30)
    world.restore(snapshot)
    first = follow(world, actions)
    world.restore(snapshot)
    follow(world, [idle(world)] * 3)
    world.restore(snapshot)
    second = follow(world, actions)
    assert all(map(torch.equal, first, second))


def test_a_row_holds_the_integration_state_exactly():
    world = make()
    to_grasp(world)
    snapshot = world.snapshot()
    follow(world, [idle(world)] * 3)
    world.restore(snapshot)
    again = world.snapshot()
    for name, value in snapshot.items(True, True):
        assert torch.equal(value, again[name]), name


def test_a_partial_restore_leaves_the_others_alone():
    world, twin = make(), make()
    snapshot = world.snapshot()
    for each in (world, twin):
        follow(each, [idle(each)] * 4)
    world.restore(snapshot, torch.tensor([False, True, False]))
    rows, expected = follow(world, [idle(world)] * 3), follow(twin, [idle(twin)] * 3)
    for row, wanted in zip(rows, expected, strict=True):
        assert torch.equal(row[[0, 2]], wanted[[0, 2]])
    assert not torch.equal(world.snapshot()["physics"][1], twin.snapshot()["physics"][1])


def test_a_snapshot_is_a_copy():
    world = make()
    snapshot = world.snapshot()
    before = snapshot.clone()
    expert_actions(world, 3)
    world.reset()
    assert all(torch.equal(value, before[name]) for name, value in snapshot.items(True, True))


def test_results_do_not_depend_on_threads():
    def trace(nthread: int) -> list[Tensor]:
        world = make(4, nthread=nthread)
        expert, rows = world.expert(), []
        for _ in range(25):
            rows += follow(world, [expert.act(world.state)])
        return rows

    assert all(map(torch.equal, trace(1), trace(2)))


@pytest.mark.parametrize(("field", "value"), [("qvel", float("nan")), ("qvel", 1e12), ("qpos", float("nan"))])
def test_a_failed_simulation_ends_alone(field, value, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log there
    world, twin = make(), make()
    for each in (world, twin):
        follow(each, [idle(each)] * 2)
    getattr(world.physics, field)[1, 3] = value
    row, wanted = follow(world, [idle(world)])[0], follow(twin, [idle(twin)])[0]
    terminated, truncated = world.task.get_termination(world.state)
    assert terminated.tolist() == [False, True, False] and not truncated.any()
    assert world.state["failed"].tolist() == [False, True, False] and not world.state["success"].any()
    assert world.failures == 1 and twin.failures == 0
    assert row.isfinite().all() and row[1, -1] == 0
    assert torch.equal(row[[0, 2]], wanted[[0, 2]])

    follow(world, [idle(world)] * 2)
    follow(twin, [idle(twin)] * 2)
    assert world.state["failed"].tolist() == [False, True, False] and world.failures == 1, "it waits"
    assert not world.state["reward"][1] and world.state["reward"][0] == twin.state["reward"][0]

    world.reset(torch.tensor([False, True, False]))
    for row, wanted in zip(follow(world, [idle(world)] * 3), follow(twin, [idle(twin)] * 3), strict=True):
        assert torch.equal(row[[0, 2]], wanted[[0, 2]]) and row.isfinite().all()
    assert not world.state["failed"].any() and world.failures == 1


def test_a_failed_simulation_restarts_from_a_snapshot_and_can_fail_again(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    world = make()
    start, second = world.snapshot(), torch.tensor([False, True, False])
    for count in (1, 2):
        world.physics.qvel[1, 0] = float("nan")
        world.step(idle(world))
        assert world.state["failed"].tolist() == second.tolist() and world.failures == count
        world.reset_to(start, second)
        world.step(idle(world))
        assert not world.state["failed"].any() and world.failures == count


def test_the_script_sees_the_arm_from_its_first_step_on():
    world = make(2, subtask=0)
    first = world.expert().act(world.state)
    assert (first[:, :7].abs().sum(-1) > 0).all()
    expert = world.expert()
    world.physics.forward()
    assert torch.equal(expert.act(world.state), first)
