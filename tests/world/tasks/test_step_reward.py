"""What one control step pays, on numbers worked by hand. Source: docs/task.md, "What every step pays"."""

import math

import gymnasium
import pytest
import torch
from scenes import LIFT, NO, OPEN, START, alignment, row, scene
from torch.testing import assert_close

import tstar_envs
from tstar_envs.tasks.scene_reader import Scene
from tstar_rl.env.furniture_env import FurnitureEnv


@pytest.fixture(scope="module")
def task():
    world = tstar_envs.load("table_lack", 1, subtask=0, nthread=1, seed=0)
    world.reset()
    return world.task


def reward(
    task, phase: int, then: Scene, grip=-1.0, connect=-1.0, connected=NO, **state
) -> tuple[float, dict]:
    """One step's reward from `scene()` to `then`, with nothing moving the arm, and the state after it."""
    before = task.new_state()
    before["phase"].fill_(phase)
    before["grip_action"].fill_(-1.0)
    for name, value in {
        "start_tip": row(*START),
        "lift_point": row(*LIFT),
        "start_target": row(0, 0, 0.1),
    }.items():
        before[name] = value
    before["potential"] = task.step_reward.potentials(scene())
    for name, value in state.items():
        before[name] = torch.full_like(before[name], value)
    action = row(*[0.0] * 7, grip, connect)
    return task.step_reward.pay(before, then, action, connected).item(), before


def test_a_step_is_ten_times_the_fall_of_the_potential(task):
    found, after = reward(task, 1, scene(tip=row(0.1, 0.2, 0.36)))
    assert_close(found, 10 * 100 * (math.hypot(0.3, 0.24) - 0.3) + 1.0)  # + 1: the hand is open
    assert after["phase"].item() == 1


@pytest.mark.parametrize(("phase", "share"), [(0, 1.0), (1, 1.0), (6, 2.0)])
def test_a_met_condition_pays_a_bonus_and_begins_the_next_phase(task, phase, share):
    then = {1: scene(tip=row(0.1, 0.2, 0.06)), 6: scene(moving_connector=row(0, 0, 0.15), touching=OPEN)}
    found, after = reward(task, phase, then.get(phase, scene()))
    fall = {0: 0.0, 1: 100 * math.hypot(0.3, 0.24), 6: 300 * 0.15}[phase]
    assert_close(found, 5000 * share + 10 * fall + (1.0 if phase <= 2 else -1.0))
    assert after["phase"].item() == phase + 1


def test_closing_pays_in_the_grasp_phase_only(task):
    assert_close(reward(task, 3, scene(), grip=1.0)[0], 200 * 2.0 + 1.0)
    assert_close(reward(task, 2, scene(), grip=1.0)[0], -1.0)


def test_a_tilted_or_turned_hand_costs_by_phase(task):
    leaning = scene(approach=row(0, 0.6, -0.8), closing=row(-0.5, math.sqrt(0.75), 0))
    costs = [reward(task, phase, leaning)[0] - reward(task, phase, scene())[0] for phase in range(1, 8)]
    bonus = 5000.0  # that phase 0 pays for the upright hand alone
    assert_close(reward(task, 0, leaning)[0] - reward(task, 0, scene())[0], 4 * -0.2 - bonus)
    assert_close(costs, [4 * -0.2 + 2 * -0.5] * 4 + [0.0] * 3)


def test_half_a_bonus_is_paid_once_for_lifting(task):
    lifted = scene(part=row(0.1, 0.2, 0.021), touching=OPEN)
    once, after = reward(task, 4, lifted, grip=1.0)
    assert after["half_paid"].item()
    assert_close(once, 2500 + 10 * 500 * 0.011 + 1.0)
    assert_close(reward(task, 4, lifted, grip=1.0, half_paid=True)[0], 10 * 500 * 0.011 + 1.0)


def test_a_dropped_part_costs_and_gains_nothing(task):
    nearer, farther = scene(part=row(0.1, 0.2, 0.015)), scene(part=row(0.1, 0.2, 0.005))
    assert_close(reward(task, 4, nearer, grip=1.0)[0], 1.0 - 20.0)
    assert_close(reward(task, 4, farther, grip=1.0)[0], -10 * 500 * 0.005 + 1.0 - 20.0)


def test_a_moved_target_costs_every_step(task):
    pushed = scene(target_connector=row(0.03, 0.04, 0.1))
    assert_close(reward(task, 1, pushed)[0], 1.0 - 50 * 0.05)


def test_asking_pays_while_aligned_and_is_taken_back_from_the_bonus(task):
    near = scene(alignment=alignment(0.01), touching=OPEN)
    gain = 10 * 500 * (math.exp(-0.25) - math.exp(-5.0))
    asked, after = reward(task, 7, near, grip=1.0, connect=0.5)
    assert_close(asked, gain + 10 * 1.5 + 1.0)
    assert_close(after["asked"].item(), 15.0)
    connected, _ = reward(task, 7, near, grip=1.0, connect=1.0, connected=OPEN, asked=15.0)
    assert_close(connected, gain + 10000 - 15.0 + 1.0)


EARLY = pytest.mark.parametrize(
    ("phase", "half_paid", "paid", "unpaid"),
    [
        (0, False, 57500.0, 10000.0),
        (3, False, 42500.0, 10000.0),
        (4, False, 37500.0, 10000.0),
        (4, True, 35000.0, 10000.0),
        (6, True, 20000.0, 10000.0),
        (7, True, 10000.0, 10000.0),
    ],
)


def gained_by_connecting(task, phase, half_paid):
    """What connecting now pays above waiting, and the state after it."""
    still = scene(touching=OPEN)
    waited, _ = reward(task, phase, still, grip=1.0, half_paid=True)
    connected, after = reward(task, phase, still, grip=1.0, connected=OPEN, half_paid=half_paid)
    return connected - waited, after


@EARLY
def test_connecting_early_pays_the_phases_left_out(task, phase, half_paid, paid, unpaid):
    gained, after = gained_by_connecting(task, phase, half_paid)
    assert_close(gained, paid)
    assert after["half_paid"].item() or phase > 4


@pytest.fixture(scope="module")
def unpaid_task():
    world = tstar_envs.load("table_lack", 1, subtask=0, nthread=1, seed=0, skipped_phases="unpaid")
    world.reset()
    return world.task


@EARLY
def test_unpaid_connecting_early_pays_its_own_bonus_alone(unpaid_task, phase, half_paid, paid, unpaid):
    gained, after = gained_by_connecting(unpaid_task, phase, half_paid)
    assert_close(gained, unpaid)
    assert after["half_paid"].item() == half_paid


def test_what_connecting_early_pays_is_a_setting_of_every_front():
    made = [
        tstar_envs.load_dm("table_lack", skipped_phases="unpaid"),
        gymnasium.make("tstar/TableLack-v0", skipped_phases="unpaid").unwrapped,
        gymnasium.make_vec("tstar/TableLack-v0", 2, skipped_phases="unpaid"),
        FurnitureEnv("table_lack", 2, skipped_phases="unpaid"),
    ]
    for env in made:
        assert env.world.arguments["skipped_phases"] == "unpaid"


def test_the_expert_that_connects_from_lifting_earns_the_rest_or_not():
    """Two simulations of the chair's first step, the same moves: only the last reward differs."""
    rewards, phases = [], []
    for value in ("paid", "unpaid"):
        world = tstar_envs.load("chair_ingolf", 2, 0, 1, 0, skipped_phases=value, part_noise=0.0)
        world.reset()
        expert, rows = world.expert(), []
        while not bool(world.state["success"].any()):
            phases.append(world.state["phase"])
            world.step(expert.act(world.state))
            rows.append(world.state["reward"])
        rewards.append(torch.stack(rows))
    difference, joined = rewards[0] - rewards[1], world.state["success"]
    assert_close(difference[:-1], torch.zeros_like(difference[:-1]))
    assert phases[-1][joined].tolist() == [4] * int(
        joined.sum()
    )  # as it goes: lifting, aligning, moving left out
    left_out = 5000.0 * (1 + 2 + 2)
    half = torch.tensor([0.0, 2500.0], dtype=torch.float64)  # whether it was lifted by a centimetre
    assert all(bool(torch.isclose(x, left_out + half).any()) for x in difference[-1][joined])


def test_unpaid_the_lift_that_was_made_still_counts(unpaid_task):
    lifted = scene(part=row(0.1, 0.2, 0.021), touching=OPEN)
    connected, _ = reward(unpaid_task, 4, lifted, grip=1.0, connected=OPEN)
    assert_close(connected, 10000.0 + 2500.0 + 10 * 500 * 0.011 + 1.0)
