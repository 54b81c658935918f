"""The states that skills hand to each other, read off the steps of an evaluation."""

import pytest
import torch
from tensordict import TensorDict

from tstar_rl.rollouts.hand_overs import HandOvers


def step(before: list[int], after: list[int], states: list[float], ended: tuple[int, ...] = ()) -> TensorDict:
    """A step of simulations that had done `before` subtasks and then `after`, and arrived in `states`.

    The episodes of those in `ended` are over then.
    """

    def column(values, dtype):
        return torch.tensor(values, dtype=dtype).unsqueeze(-1)

    done = [row in ended for row in range(len(before))]
    following = {"completed": column(after, torch.int64), "observation": column(states, torch.float32)}
    following["done"] = column(done, torch.bool)
    return TensorDict({"completed": column(before, torch.int64), "next": following}, [len(before)])


def test_a_seam_has_the_state_in_which_a_subtask_was_done_and_whether_the_next_was_done_later():
    watch = HandOvers(3)
    watch(step([0, 0, 0, 0], [1, 0, 0, 1], [10.0, 20.0, 30.0, 40.0]))
    watch(step([1, 0, 0, 1], [1, 1, 0, 2], [11.0, 21.0, 31.0, 41.0]))
    watch(step([1, 1, 0, 2], [2, 1, 0, 3], [12.0, 22.0, 32.0, 42.0]))
    first, second = watch.seams()
    assert (first.subtask, second.subtask) == (1, 2)
    assert first.observations.squeeze(-1).tolist() == [10.0, 21.0, 40.0]
    assert first.succeeded.tolist() == [True, False, True]
    assert second.observations.squeeze(-1).tolist() == [12.0, 41.0]
    assert second.succeeded.tolist() == [False, True]


def test_a_simulation_that_was_reset_does_not_lose_what_its_first_episode_did():
    watch = HandOvers(2)
    watch(step([0], [2], [1.0]))
    watch(step([0], [0], [5.0]))
    (seam,) = watch.seams()
    assert seam.observations.tolist() == [[1.0]]
    assert seam.succeeded.tolist() == [True]


def test_what_is_done_in_an_episodes_last_step_is_handed_to_nobody():
    """As at the time limit, or where that step has moved another part away."""
    watch = HandOvers(2)
    watch(step([0, 0], [1, 1], [10.0, 20.0], ended=(1,)))
    watch(step([1, 1], [2, 1], [11.0, 20.0], ended=(0,)))
    (seam,) = watch.seams()
    assert seam.observations.tolist() == [[10.0]] and seam.succeeded.tolist() == [True]


def test_a_seam_that_nothing_reached_is_empty():
    watch = HandOvers(3)
    watch(step([0, 0], [0, 1], [1.0, 2.0]))
    first, second = watch.seams()
    assert (len(first.observations), len(second.observations)) == (1, 0)


def test_what_makes_no_sense_is_refused():
    with pytest.raises(ValueError, match="at least two skills, got 1"):
        HandOvers(1)
    with pytest.raises(ValueError, match="each_step"):
        HandOvers(2).seams()
