"""When parts connect: where it is asked for, the part is held, and the connectors are aligned."""

import torch
from worlds import aligned, idle, make


def test_nothing_connects_where_nobody_asks_or_asks_from_afar():
    world = make(2)
    asking = idle(world)
    asking[:, 8] = 1.0
    world.step(asking)
    assert not world.state["completed"].any() and not world.state["wrong"].any()
    expert = world.expert()
    for _ in range(60):
        action = expert.act(world.state)
        action[:, 8] = -1.0
        world.step(action)
    assert aligned(world).any() and not world.state["completed"].any()
    assert not world.physics.eq_active.any()


def test_what_is_aligned_and_not_held_does_not_connect(monkeypatch):
    world = make(2)
    expert = world.expert()
    for _ in range(200):
        action = expert.act(world.state)
        action[:, 8] = -1.0
        world.step(action)
        if aligned(world).all():
            break
    here, asking = world.snapshot(), idle(world)
    asking[:, 8] = 1.0
    asking[:, 7] = action[:, 7]  # the hand stays closed
    reader = world.task._reader
    with monkeypatch.context() as patch:
        patch.setattr(reader, "_contacts", torch.zeros_like(reader._contacts))
        world.step(asking)
        assert not world.physics.eq_active.any() and not world.state["completed"].any()
    world.restore(here)
    world.step(asking)
    assert world.state["completed"].tolist() == [1, 1]


def test_what_is_held_and_not_aligned_does_not_connect():
    world = make(1)
    expert = world.expert()
    while not world.task.scene(world.state).touching.all():
        action = expert.act(world.state)
        action[:, 8] = -1.0
        world.step(action)
    action[:, 8] = 1.0
    world.step(action)
    assert world.task.scene(world.state).touching.all() and not aligned(world).any()
    assert not world.physics.eq_active.any() and not world.state["completed"].any()
