"""Which steps of the scripted expert become demonstrations, and what each of their rows is."""

from dataclasses import replace

import pytest
import torch

from tstar_envs.furniture import library
from tstar_rl import FurnitureEnv
from tstar_rl.demonstrations.collect import collect
from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.demonstrations.header import DemonstrationError
from tstar_rl.env.task_tables import furniture_digest, piece_digest
from tstar_rl.rollouts.collection import with_starts
from tstar_rl.rollouts.episodes import run_episodes

TASK, NUM_ENVS, EPISODES, NOISE, SEED = "table_lack", 3, 5, 0.1, 7
WORLD = {"task": TASK, "subtask": 0, "nthread": 1, "velocity_scale": 0.4, "max_steps": 120}


def make(seed: int, num_envs: int = NUM_ENVS) -> FurnitureEnv:
    return FurnitureEnv(num_envs=num_envs, seed=seed, snapshots=True, **WORLD)


@pytest.fixture(scope="module")
def made() -> Demonstrations:
    """Five successes of two rounds of three simulations."""
    return collect(lambda seed: with_starts(make(seed)), EPISODES, "noisy", NOISE, SEED)


def test_it_takes_two_rounds_and_each_has_starts_of_its_own(made):
    assert len(made) == EPISODES and made.seeds.tolist() == [7, 7, 7, 8, 8]
    begins = made.lengths.cumsum(0) - made.lengths
    first = made.observations[begins]
    assert len(first.unique(dim=0)) == EPISODES
    assert (made.snapshots["task", "episode_step"][begins] == 0).all()


@pytest.mark.parametrize("fails", ["one", "all"])
def test_what_fails_is_no_demonstration(monkeypatch, fails):
    succeeds = torch.tensor({"one": [[True], [False], [True]], "all": [[False]] * 3}[fails])

    def some_fail(*given):
        last = run_episodes(*given)
        last["next", "success"] &= succeeds
        return last

    monkeypatch.setattr("tstar_rl.demonstrations.collect.run_episodes", some_fail)
    monkeypatch.setattr("tstar_rl.demonstrations.collect.ROUNDS", 1)
    if fails == "all":
        with pytest.raises(
            DemonstrationError, match="only 0 of the 1 successes wanted came of 5 rounds of 3"
        ):
            collect(lambda seed: with_starts(make(seed)), 1, "noisy", NOISE, SEED)
    else:
        found = collect(lambda seed: with_starts(make(seed)), 4, "noisy", NOISE, SEED)
        assert len(found) == 4 and found.seeds.tolist() == [7, 7, 8, 8]


def test_labels_are_clean_and_what_was_executed_has_noise_on_the_arm_alone(made):
    assert torch.equal(made.actions[:, 7:], made.executed[:, 7:])  # gripper, connect
    inside = made.executed[:, :7].abs() < 1  # not clipped
    noise = (made.executed - made.actions)[:, :7][inside]
    assert (noise != 0).all() and float(noise.std()) == pytest.approx(NOISE, rel=0.1)
    plain = collect(lambda seed: with_starts(make(seed, 1)), 1, "plain", NOISE, SEED)
    assert torch.equal(plain.actions, plain.executed) and plain.noise == 0.0
    assert made.furniture == furniture_digest(made.task)


def test_only_a_piece_of_the_library_has_a_digest():
    piece = library.load("toy_table")
    assert piece_digest(piece) == furniture_digest("toy_table")
    assert piece_digest(replace(piece, name="mine")) is piece_digest(replace(piece)) is None


def test_the_last_step_of_each_is_the_one_that_succeeds(made):
    """What was executed is done again from the states before it, in the last steps and in those before them."""
    ends = made.lengths.cumsum(0) - 1
    env = make(0, EPISODES)
    env.reset()
    for rows, success in ((ends - 1, False), (ends, True)):
        env.restore(made.snapshots[rows])
        env.world.step(made.executed[rows])
        assert env.world.state["success"].tolist() == [success] * EPISODES
