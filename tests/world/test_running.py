"""Stepping only some simulations: the others wait, and nobody notices."""

import pytest
import torch
from tensordict import TensorDict
from torch import Tensor
from worlds import make

from tstar_envs.environment import BatchedEnvironment
from tstar_rl.env.furniture_env import FurnitureEnv
from tstar_rl.rollouts.collection import with_starts

N = 4
FAILED = torch.tensor([False, True, False, False])


def recorded(steps: int, **arguments) -> tuple[list[Tensor], list[Tensor], list[TensorDict]]:
    """What the expert does in all simulations: actions, outputs, and snapshots before each step."""
    world = make(N, **arguments)
    expert, actions, outputs, snapshots = world.expert(), [], [], []
    for _ in range(steps):
        snapshots.append(world.snapshot())
        actions.append(expert.act(world.state))
        world.step(actions[-1])
        outputs.append(outward(world))
    return actions, outputs, [*snapshots, world.snapshot()]


def outward(world: BatchedEnvironment) -> Tensor:
    state = world.state
    flags = [torch.stack(world.task.get_termination(state), -1), state["success"].unsqueeze(-1)]
    return torch.cat([world.observation(), state["reward"].unsqueeze(-1), *flags], dim=-1)


def same_rows(one: TensorDict, other: TensorDict, rows: Tensor) -> bool:
    return all(torch.equal(value[rows], other[name][rows]) for name, value in one.items(True, True))


def test_a_simulation_that_waited_goes_on_as_if_it_had_not():
    """Through grasps and connections: simulation i waits every (i + 2)-th step, and is never stepped elsewhere."""
    actions, outputs, snapshots = recorded(120, subtask=None, seed=3)
    assert any(snapshot["task", "completed"].any() for snapshot in snapshots)
    world, at = make(N, None, 3), torch.zeros(N, dtype=torch.long)
    rows = torch.arange(N)
    for step in range(120):
        running = (step % (rows + 2) != 0) & (at < 120)
        action = torch.stack([actions[int(k)][i] for i, k in enumerate(at.clamp(max=119))])
        action[~running] = float("nan")  # not read
        before = world.snapshot()
        world.step(action, running)
        assert same_rows(world.snapshot(), before, ~running)
        for i in rows[running]:
            assert torch.equal(outward(world)[i], outputs[int(at[i])][i])
        at += running
        for i in rows:
            assert same_rows(world.snapshot(), snapshots[int(at[i])], rows == i)
    assert sorted(at.tolist()) == at.tolist() and 50 < at[0] < at[-1]


def test_a_reset_of_no_simulation_changes_nothing():
    world = make(N, 0, 3)
    world.reset()
    before, drawn = world.snapshot(), world.generator.get_state()
    world.reset(torch.zeros(N, dtype=torch.bool))
    assert same_rows(world.snapshot(), before, torch.arange(N))
    assert torch.equal(world.generator.get_state(), drawn)


def test_a_step_of_no_simulation_changes_none():
    world = make(N)
    before = world.snapshot()
    world.step(torch.ones(N, 9), torch.zeros(N, dtype=torch.bool))
    assert same_rows(world.snapshot(), before, torch.ones(N, dtype=torch.bool))


def test_a_simulation_that_fails_is_counted_once_and_only_while_it_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its log there
    world = make(N)
    world.physics.qvel[FAILED, 0] = float("nan")
    world.step(torch.zeros(N, 9), ~FAILED)
    assert world.failures == 0 and not world.state["failed"].any()
    world.step(torch.zeros(N, 9), FAILED)
    assert world.failures == 1 and torch.equal(world.state["failed"], FAILED)
    world.step(torch.zeros(N, 9), ~FAILED)
    assert world.failures == 1 and torch.equal(world.state["failed"], FAILED)  # what its last step did


@pytest.mark.parametrize("mask", [torch.ones(3, dtype=torch.bool), torch.ones(N)])
def test_a_mask_that_is_none(mask):
    with pytest.raises(ValueError, match=r"are meant is a mask of shape \(4,\), torch.bool; got "):
        make(N).step(torch.zeros(N, 9), mask)


def test_torchrl_steps_some_through_its_transforms():
    def stepped(which: list[bool]) -> TensorDict:
        env = with_starts(FurnitureEnv("table_lack", N, 0, 1, seed=0, snapshots=True))
        tensordict, expert = env.reset(), env.base_env.expert()
        for _ in range(3):
            tensordict = env.step_mdp(env.step(expert(tensordict)))
        expert(tensordict).set("_step", torch.tensor(which).unsqueeze(-1))
        return env.step(tensordict)

    some, every = stepped([True, False, False, True]), stepped([True] * 4)
    for key in ("observation", "reward_env", "snapshot", "done", "subtask", "phase"):
        value, wanted, before = some["next", key], every["next", key], some.get(key, None)
        value, wanted = (v["physics"] if key == "snapshot" else v for v in (value, wanted))
        assert torch.equal(value[[0, 3]], wanted[[0, 3]]), key
        if key in ("observation", "snapshot"):
            before = before["physics"] if key == "snapshot" else before
            assert torch.equal(value[[1, 2]], before[[1, 2]]) and not torch.equal(
                value[[1, 2]], wanted[[1, 2]]
            )
    assert not some["next", "reward_env"][[1, 2]].any() and every["next", "reward_env"].all()
