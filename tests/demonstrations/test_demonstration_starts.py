"""Episodes begin in states of demonstrations: all of them, none beyond the time limit."""

import pytest
import torch
from recorded import made_up
from tensordict import TensorDict

from tstar_rl.checks import InvalidValueError
from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.demonstrations.starts import DemonstrationStarts


@pytest.fixture
def demonstrations() -> Demonstrations:
    return made_up()


def test_starts_are_drawn_from_every_step_of_every_episode(demonstrations):
    starts = DemonstrationStarts(demonstrations, 5)
    drawn = starts.sample(700, torch.Generator().manual_seed(0))
    counts = drawn["task", "phase"].bincount(minlength=7)
    assert drawn.batch_size == (700,) and counts.min() > 60 and counts.max() < 140
    row = demonstrations.snapshots[int(drawn["task", "phase"][0])]
    assert torch.equal(drawn["physics"][0], row["physics"])
    demonstrations.snapshots = TensorDict({}, [7])
    with pytest.raises(InvalidValueError, match="demonstration_starts needs demonstrations with full states"):
        DemonstrationStarts(demonstrations, 5)


def test_no_start_is_beyond_the_time_limit_of_training(demonstrations):
    """Episodes of three and four steps: with a limit of two, one that began in a later state would end at once."""
    made = torch.tensor([0, 1, 2, 0, 1, 2, 3])
    demonstrations.snapshots["task", "episode_step"] = made.clone()
    drawn = DemonstrationStarts(demonstrations, 2).sample(200, torch.Generator().manual_seed(0))
    assert drawn["task", "episode_step"].unique().tolist() == [0, 1]
    short = DemonstrationStarts(demonstrations, 2, steps=1).sample(200, torch.Generator().manual_seed(0))
    assert (short["task", "episode_step"] == 1).all() and len(short["task", "phase"].unique()) == 7
    assert torch.equal(demonstrations.snapshots["task", "episode_step"], made)


def test_demonstrations_that_begin_beyond_the_time_limit_are_refused(demonstrations):
    demonstrations.snapshots["task", "episode_step"] = torch.arange(7) + 5
    with pytest.raises(InvalidValueError, match="no demonstration has a state before step 5, .*max_steps"):
        DemonstrationStarts(demonstrations, 5)
    assert len(DemonstrationStarts(demonstrations, 5, steps=2).snapshots) == 7


def test_an_episode_from_a_demonstration_is_no_longer_than_the_time_limit(demonstrations):
    drawn = DemonstrationStarts(demonstrations, 5, steps=5).sample(9, torch.Generator().manual_seed(0))
    assert (drawn["task", "episode_step"] == 0).all()
    with pytest.raises(
        InvalidValueError, match=r"demonstration_steps must be at most 5, .*max_steps.*; got 6"
    ):
        DemonstrationStarts(demonstrations, 5, steps=6)
