"""Snapshots of other furniture, or with something missing, are refused in every front; one's own never is."""

import gymnasium
import pytest
import torch
from tensordict import TensorDict
from worlds import make

import tstar_envs
from tstar_envs.environment import BatchedEnvironment
from tstar_rl.env.furniture_env import FurnitureEnv

TABLE, CHAIR = "table_lack", "chair_ingolf"
OTHER = "not taken of table_lack as it is now: its welds are those of other furniture"


@pytest.fixture(scope="module")
def table() -> BatchedEnvironment:
    return make(2, 0)


@pytest.fixture(scope="module")
def chair() -> TensorDict:
    return make(2, 0, name=CHAIR).snapshot()


def stretched(physics: torch.Tensor, by: float = 3.0) -> torch.Tensor:
    """The second row with the first part's quaternion times `by`; nine joints and its position stand before it."""
    time, joints, position = 1, 9, 3
    first = time + joints + position
    return torch.cat([physics[:1], physics[1:].index_put((torch.tensor(0), torch.arange(first, first + 4)),
                                                         by * physics[1, first : first + 4])])  # fmt: skip


def starts(snapshot: TensorDict, *use: bool) -> TensorDict:
    return TensorDict({"start": {"snapshot": snapshot, "use": torch.tensor(use).unsqueeze(-1)}}, [2])


def test_the_chair_is_refused_in_every_front(table, chair):
    """Rows are as wide as the table's: nothing else would tell."""
    own = table.snapshot()
    assert all(value.shape == chair[name].shape for name, value in own.items(True, True))
    env = FurnitureEnv(TABLE, 2, 0, seed=0)
    ways = [
        lambda: table.restore(chair),
        lambda: table.reset_to(chair),
        lambda: env.restore(chair),
        lambda: env.reset(starts(chair, True, True)),
        lambda: tstar_envs.load_dm(TABLE, 0).reset_to(chair[:1]),
        lambda: gymnasium.make("tstar/TableLack-v0", subtask=0).reset(options={"snapshot": chair[:1]}),
        lambda: gymnasium.make_vec("tstar/TableLack-v0", 2, subtask=0).reset(options={"snapshot": chair}),
    ]
    for way in ways:
        with pytest.raises(ValueError, match=f"the snapshot in simulation 0 was {OTHER}"):
            way()
    assert all(torch.equal(value, own[name]) for name, value in table.snapshot().items(True, True))


def test_rows_that_are_not_used_may_be_anything(table, chair):
    mixed = torch.cat([table.snapshot()[:1], chair[1:]])
    table.restore(mixed, torch.tensor([True, False]))
    FurnitureEnv(TABLE, 2, 0, seed=0).reset(starts(mixed, True, False))
    with pytest.raises(ValueError, match=f"the snapshot in simulation 1 was {OTHER}"):
        table.restore(mixed)


@pytest.mark.parametrize("name", [TABLE, CHAIR])
@pytest.mark.parametrize("settings", [{}, {"preassembled": "jitter"}, {"snap": True, "part_noise": 0.0}])
def test_ones_own_are_taken_at_every_subtask(name, settings):
    for subtask in range(4):
        world = make(3, subtask, name=name, **settings)
        snapshot = world.snapshot()
        make(3, subtask, seed=1, name=name).reset_to(snapshot)
        world.restore(snapshot)


def finished(name: str) -> TensorDict:
    """A whole piece: every step made, jittered as much as the setting goes by default."""
    world = make(2, 3, name=name, preassembled="jitter")
    world.task.connect_ideally(3, torch.ones(2, dtype=torch.bool))
    world.task.starts.weld(3, torch.ones(2, dtype=torch.bool))
    return world.snapshot().set(("task", "subtask"), torch.tensor([4, 4]))


def test_finished_pieces_are_told_apart_by_what_their_welds_join():
    whole = make(2, None)
    whole.restore(finished(TABLE))
    with pytest.raises(ValueError, match=OTHER):
        whole.restore(finished(CHAIR))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda s: s.exclude("welds"), "table_lack needs 'welds', this one has physics, task; take what snapshot"),
        (lambda s: s.exclude(("task", "phase")), r"needs 'task\.phase'"),
        (lambda s: s.exclude("task"), r"needs 'task\.subtask', this one has physics, welds"),
        (lambda s: s.set("physics", s["physics"][:, 1:]), r"'physics' of a .* has shape \(2, \d+\), got \(2, \d+\)"),
        (lambda s: s.set("welds", s["welds"][:, :3]), r"'welds' .* \(2, 4, \d+\), got \(2, 3, \d+\): was it taken of"),
        (lambda s: s[:1], r"a snapshot of 2 simulations is needed, got \(1,\)"),
        (lambda s: s.to_dict(), "is the TensorDict that snapshot.. gives, got a dict"),
        (lambda s: s.set("welds", torch.nan * s["welds"]), "'welds' of a .* is not finite, .* in simulation 0"),
        (lambda s: s.set("physics", s["physics"].float()), "'physics' of a .* is of torch.float64, got torch.float32"),
        (lambda s: s.set(("task", "subtask"), torch.tensor([0, 2])),
         r"simulation 1 is of no state of table_lack: at subtask 2 the welds of the steps .* those of steps \[\]"),
        (lambda s: s.set(("task", "subtask"), torch.tensor([0, -3])), r"'task\.subtask' .*got -3 in simulation 1"),
        (lambda s: s.set(("task", "subtask"), torch.tensor([5, 0])), r"'task\.subtask' .*got 5 in simulation 0"),
        (lambda s: s.set(("task", "phase"), torch.tensor([0, 12])), r"'task\.phase' .* in 0\.\.7, got 12 in"),
        (lambda s: s.set(("task", "episode_step"), torch.tensor([0, -9])), r"'task\.episode_step' .* count, got -9 in"),
        (lambda s: s.set(("task", "completed"), torch.tensor([-1, 0])), r"'task\.completed' .* is a count, got -1 in"),
        (lambda s: s.set("physics", torch.nan * s["physics"]), "'physics' .*is not finite, .* in simulation 0"),
        (lambda s: s.set("physics", torch.inf + s["physics"]), "'physics' .*is not finite, .* in simulation 0"),
        (lambda s: s.set("physics", 1e12 + s["physics"]), "'physics' .*, or beyond the 1e.10 at which MuJoCo gives up"),
        (lambda s: s.set(("task", "potential"), torch.nan * s["task", "potential"]), "'task.potential' .* not finite"),
        (lambda s: s.set(("task", "reward"), torch.tensor([0, torch.nan]).double()),
         "'task.reward' .* is not finite, .* in simulation 1"),
        (lambda s: s.set("physics", stretched(s["physics"])), "quaternion .* in simulation 1 has length 3, not 1"),
        (lambda s: s.set("physics", stretched(s["physics"], 0.5)), "quaternion .* has length 0.5, not 1"),
    ],
)  # fmt: skip
def test_what_is_missing_or_of_another_shape_is_named(table, change, message):
    for take in (table.restore, table.reset_to):
        with pytest.raises(ValueError, match=message):
            take(change(table.snapshot()))


@pytest.mark.parametrize(
    ("moved", "message"), [(5.0, "not taken of table_lack"), (torch.nan, "is not finite")]
)
def test_a_weld_that_holds_must_join_its_connectors(moved, message):
    world = make(2, 2)
    snapshot = world.snapshot()
    snapshot["welds"][1, 1, 3] += moved
    for take in (world.restore, world.reset_to):
        with pytest.raises(ValueError, match=f"{message}.*" if moved == 5.0 else message):
            take(snapshot)
        take(snapshot, torch.tensor([True, False]))


def test_a_simulation_that_was_given_up_is_restored_without_its_welds():
    world = make(2, 2)
    world.physics.qpos[0] = torch.inf
    world.step(torch.zeros(2, 9, dtype=torch.float64))
    assert world.state["failed"].tolist() == [True, False]
    world.restore(world.snapshot())
    with pytest.raises(ValueError, match="start from the snapshot in simulation 0: that one was given up"):
        world.reset_to(world.snapshot())
    world.reset_to(world.snapshot(), torch.tensor([False, True]))


def test_a_simulation_that_had_not_begun_is_no_start_and_has_not_begun_after_it_is_restored():
    begun, unbegun = make(2, 2), BatchedEnvironment("table_lack", 2, 2)
    with pytest.raises(ValueError, match="simulation 0: that one had not begun: call reset"):
        begun.reset_to(unbegun.snapshot())
    begun.restore(unbegun.snapshot(), torch.tensor([False, True]))
    with pytest.raises(ValueError, match="no episode of table_lack was begun in simulation 1"):
        begun.step(torch.zeros(2, 9))
    begun.step(torch.zeros(2, 9), torch.tensor([True, False]))


def test_a_subtask_that_episodes_never_come_to_is_refused():
    first, third, whole = make(2, 0), make(2, 2), make(2, None)
    before = first.snapshot()
    with pytest.raises(
        ValueError, match="subtask 0 of table_lack never come to .* simulation 0 is, at subtask 2"
    ):
        first.restore(third.snapshot())
    assert torch.equal(first.snapshot()["physics"], before["physics"])
    whole.restore(third.snapshot())
    ended = make(2, 1).snapshot()
    ended["task", "completed"] = torch.tensor([1, 1])
    first.restore(ended)  # where an episode of subtask 0 has succeeded


def test_ones_own_is_taken_where_an_episode_was_stepped_on_after_its_success():
    world = make(2, 0)
    expert = world.expert()
    while not bool(world.state["success"].any()):
        world.step(expert.act(world.state))
    world.step(torch.zeros(2, 9))
    assert (world.state["subtask"].eq(1) & ~world.state["success"]).any()
    snapshot = world.snapshot()
    world.restore(snapshot)
    assert torch.equal(world.state["subtask"], snapshot["task", "subtask"])


def test_ones_own_is_taken_where_an_episode_went_on_from_the_one_before():
    """What the skill before completed is not this one's: 'completed' counts from the environment's own subtask."""
    before, world = make(1, 0), make(1, 1)
    before.reset()
    expert = before.expert()
    while not before.state["success"].any():
        before.step(expert.act(before.state))
    world.restore(before.snapshot())
    assert not world.state["completed"].any() and world.state["subtask"].item() == 1
    expert = world.expert()
    while world.state["subtask"].item() == 1:
        world.step(expert.act(world.state))
    assert world.state["completed"].item() == 1
    world.restore(world.snapshot())
    assert world.state["completed"].item() == 1


def test_positions_are_of_this_furniture_and_its_quaternions_turn():
    world, other = make(1, 0), make(1, 0, name="table_bjorkudden_0206")
    with pytest.raises(ValueError, match="has shape .*: was it taken of other furniture"):
        world.qpos_of(other.snapshot())
    qpos = world.qpos_of(world.snapshot())
    assert world.with_qpos(world.snapshot(), qpos)[1].all()
    qpos[:, -4:] = 0.0
    assert not world.with_qpos(world.snapshot(), qpos)[1].any()
