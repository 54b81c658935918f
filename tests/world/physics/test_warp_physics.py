"""The GPU's simulator: snapshots, masks, welds of each simulation, failures, room, starts made in advance."""

import gc
import sys
import weakref

import pytest
import torch
import warp_worlds
from tensordict import TensorDict
from torch import Tensor
from torch.testing import assert_close
from torchrl.envs import check_env_specs

import tstar_envs
from tstar_envs.environment import BatchedEnvironment
from tstar_envs.physics import warp, warp_scene
from tstar_envs.physics.warp import WarpPhysics
from tstar_rl.env.furniture_env import FurnitureEnv
from tstar_rl.rollouts.collection import with_starts

pytestmark = pytest.mark.parametrize("device", warp_worlds.DEVICES)


def idle(world: BatchedEnvironment) -> Tensor:
    action = torch.zeros(world.num_sims, 9, dtype=torch.float64, device=world.physics.device)
    action[:, 7:] = -1.0
    return action


def follow(world: BatchedEnvironment, actions: list[Tensor]) -> list[Tensor]:
    """Observations and rewards of each step."""
    rows = []
    for action in actions:
        world.step(action)
        rows.append(torch.cat([world.observation(), world.state["reward"].unsqueeze(-1)], dim=-1))
    return rows


def agree(device: str, ours: list[Tensor], theirs: list[Tensor]) -> None:
    """To the bit on the processor; on a GPU, where contacts are summed in any order, to rounding."""
    for one, other in zip(ours, theirs, strict=True):
        assert torch.equal(one, other) if device == "cpu" else torch.allclose(one, other, atol=5e-2)


def second(world: BatchedEnvironment) -> Tensor:
    return torch.arange(world.num_sims, device=world.physics.device) == 1


def test_restores_agree_with_a_weld_active_and_a_part_in_the_hand(device):
    world = warp_worlds.make(2, subtask=1, device=device)
    expert = world.expert()
    while not bool((world.state["phase"] >= 5).all()):
        world.step(expert.act(world.state))
    assert world.task.scene(world.state).touching.all() and (world.physics.eq_active[:, 0] == 1).all()
    snapshot, observation, actions = world.snapshot(), world.observation(), []
    expected = []
    for _ in range(4):
        actions.append(expert.act(world.state))
        expected += follow(world, actions[-1:])
    world.restore(snapshot)
    assert torch.equal(world.observation()[:, :64], observation[:, :64])
    assert all(torch.equal(v, world.snapshot()[k]) for k, v in snapshot.items(True, True))
    agree(device, follow(world, actions), expected)  # as if nothing had been restored: nothing sleeps here
    other = warp_worlds.make(2, subtask=1, seed=9, device=device)
    other.restore(snapshot)
    agree(device, follow(other, actions), expected)


def test_a_partial_restore_and_a_partial_reset_leave_the_others_alone(device):
    world, twin = (warp_worlds.make(device=device) for _ in range(2))
    snapshot = world.snapshot()
    for each in (world, twin):
        follow(each, [idle(each)] * 2)
    world.restore(snapshot, second(world))
    rows, expected = follow(world, [idle(world)] * 2), follow(twin, [idle(twin)] * 2)
    agree(device, [row[[0, 2]] for row in rows], [row[[0, 2]] for row in expected])
    world.reset(second(world))
    rows, expected = follow(world, [idle(world)]), follow(twin, [idle(twin)])
    agree(device, [row[[0, 2]] for row in rows], [row[[0, 2]] for row in expected])
    assert not torch.equal(rows[0][1], expected[0][1])


def test_settling_some_leaves_the_others_alone(device):
    world = warp_worlds.make(device=device)
    before = world.physics.state()
    world.physics.qpos[:, 11] += 0.05  # a part in the air
    lifted = world.physics.state()
    assert not world.physics.settle(second(world), 3).any()
    after = world.physics.state()
    assert torch.equal(after[[0, 2]], lifted[[0, 2]]) and not torch.equal(after[1], lifted[1])
    assert not torch.equal(before, lifted)


def test_starts_are_those_of_the_processor(device):
    """Made N at a time, in the order in which the generator draws them; the same for a seed after a reset of some."""
    world, cpu = warp_worlds.make(device=device), tstar_envs.load("table_lack", 3, 0, 1, 0)
    cpu.reset()
    assert_close(world.observation().cpu(), cpu.observation(), atol=1e-4, rtol=0)
    cpu.reset()
    world.reset(second(world))
    assert_close(world.observation()[1].cpu(), cpu.observation()[0], atol=1e-4, rtol=0)
    world.reset(~second(world))
    assert_close(world.observation()[[0, 2]].cpu(), cpu.observation()[1:], atol=1e-4, rtol=0)
    world.seed(0)
    world.reset()
    fresh = warp_worlds.make(device=device)
    agree(device, [world.observation()], [fresh.observation()])


def test_every_simulation_has_welds_of_its_own(device):
    world = warp_worlds.make(subtask=1, preassembled="jitter", device=device)
    apart = world.physics.eq_data[:, 0, 3:6]
    assert (apart[0] - apart[1]).abs().max() > 1e-3
    follow(world, [idle(world)] * 5)
    target, moving = (
        world.task.part_poses[:, index[0]] for index in (world.task.tables.target, world.task.tables.moving)
    )
    found = tstar_envs.geometry.relative_pose(target[:, :3], target[:, 3:], moving[:, :3], moving[:, 3:])
    assert_close(found[0], apart, atol=2e-3, rtol=0)


def test_simulations_that_do_not_run_wait(device):
    world, twin = (warp_worlds.make(device=device) for _ in range(2))
    before, running = world.snapshot(), ~second(world)
    actions = [torch.linspace(-1, 1, 9, dtype=torch.float64, device=device).repeat(3, 1)] * 4
    for action, wanted in zip(actions, follow(twin, actions), strict=True):
        world.step(action, running)
        agree(device, [world.observation()[running]], [wanted[running, :-1]])
        assert all(torch.equal(v[1], world.snapshot()[k][1]) for k, v in before.items(True, True))


@pytest.mark.parametrize("value", [float("nan"), 1e12])
def test_a_failed_simulation_ends_alone(device, value):
    world, twin = (warp_worlds.make(device=device) for _ in range(2))
    world.physics.qvel[1, 3] = value
    row, wanted = follow(world, [idle(world)])[0], follow(twin, [idle(twin)])[0]
    assert world.state["failed"].tolist() == [False, True, False] and world.failures == 1
    assert row.isfinite().all() and row[1, -1] == 0
    agree(device, [row[[0, 2]]], [wanted[[0, 2]]])
    world.reset(second(world))
    assert follow(world, [idle(world)])[0].isfinite().all() and not world.state["failed"].any()


SMALL_ROOMS = {
    "simulation 0 needs more room than 32 constraint rows.*warp_scene": (64, 32, 8),
    "3 simulations together need more room than 12 contacts and 12 convex pairs, 4 and 4 for each.*warp_scene": (
        4, 256, 4,
    ),
}  # fmt: skip


@pytest.mark.parametrize("said", SMALL_ROOMS)
def test_too_little_room_for_a_scene_at_rest_is_an_error(device, said, monkeypatch):
    monkeypatch.setattr(warp, "room", lambda model: warp_scene.Room(*SMALL_ROOMS[said]))
    with pytest.raises(RuntimeError, match=said):
        warp_worlds.make(device=device)


def test_without_room_for_its_constraint_rows_a_simulation_fails_alone(device):
    world = warp_worlds.make(device=device)
    world.physics._overflow[1] |= 1  # NEFC
    follow(world, [idle(world)])
    assert world.state["failed"].tolist() == [False, True, False] and world.failures == 1
    world.reset(second(world))
    follow(world, [idle(world)])
    assert not world.state["failed"].any()


def test_a_lost_contact_is_an_error_when_it_is_looked_for(device, monkeypatch):
    monkeypatch.setattr(warp, "CHECKED_EVERY", 2)
    world = warp_worlds.make(device=device)
    world.physics._overflow[:] |= 8  # NARROWPHASE: every simulation is marked, whosever contact it was
    follow(world, [idle(world)])
    with pytest.raises(RuntimeError, match="3 simulations together need more room than"):
        follow(world, [idle(world)])
    with pytest.raises(RuntimeError, match="3 simulations together"):
        world.physics.check_room()


def test_nothing_waits_for_the_garbage_collector(device):
    env = with_starts(FurnitureEnv("table_lack", 2, device=device, seed=0, physics="warp"))
    env.reset()
    physics = env.base_env.world.physics
    expected = physics.state()
    bare = WarpPhysics(physics.model, 2, device)
    held = [
        weakref.ref(each) for each in (physics._data, physics._model, physics._data.qpos, bare, bare._data)
    ]
    gc.collect()
    gc.disable()
    try:
        env.close()
        env.close()
        del bare
        assert [reference() for reference in held] == [None] * len(held)
    finally:
        gc.enable()
    assert torch.equal(physics.state(), expected)
    with pytest.raises(RuntimeError, match="these simulations were closed"):
        physics.step(1)


def test_the_torchrl_front(device):
    env = FurnitureEnv("table_lack", 2, device=device, seed=0, snapshots=True, physics="warp")
    check_env_specs(env, seed=0)
    first = env.reset()
    state = env.state_dict()
    env.load_state_dict(state)
    resumed = FurnitureEnv("table_lack", 2, device=device, seed=7, snapshots=True, physics="warp")
    resumed.load_state_dict(state)
    assert first["observation"].device.type == device
    action = TensorDict({"action": env.action_spec.rand()}, [2])
    agree(
        device,
        [env.step(action)["next", "observation"], env.reset()["observation"]],
        [resumed.step(action)["next", "observation"], resumed.reset()["observation"]],
    )


def test_what_is_missing_is_named(device, monkeypatch):
    if device == "cpu" and not torch.cuda.is_available():
        with pytest.raises(
            ValueError, match="torch finds no CUDA device; device='cpu' simulates with MuJoCo"
        ):
            FurnitureEnv("table_lack", device="cuda")
    monkeypatch.setitem(sys.modules, "mujoco_warp", None)
    with pytest.raises(ImportError, match=r"needs the extra 'gpu': pip install 'tstar_rl\[gpu\]'"):
        FurnitureEnv("table_lack", device=device, physics="warp")
