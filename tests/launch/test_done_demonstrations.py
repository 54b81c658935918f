"""Which demonstrations need not be made again."""

import pytest
from finished_steps import finish

from tstar_rl.demonstrations.header import DemonstrationError
from tstar_rl.launch.steps import is_done


def test_demonstrations_are_done_if_every_file_is_there(shared):
    one = ("make_demonstrations", "subtask=0", "kinds=[noisy]")
    finish(one, shared, at=1)
    assert is_done(one, shared)
    for other in (("kinds=[plain]", "subtask=0"), ("kinds=[noisy]",), ("whole=true", "kinds=[noisy]")):
        assert not is_done(("make_demonstrations", *other), shared)


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (
            "demonstrations.episodes=7",
            "subtask0_noisy.npz: it has 100 episodes, and demonstrations.episodes is 7",
        ),
        (
            "demonstrations.noise=0.3",
            "a noise of 0.15, and demonstrations.noise is 0.3; delete it, or set resume=fal",
        ),
        ("+env.snap=true", "snap was False when it was saved, and is True now"),
    ],
)
def test_demonstrations_that_were_made_otherwise_are_not_passed_over(shared, other, message):
    one = ("make_demonstrations", "subtask=0", "kinds=[noisy]")
    finish(one, shared, at=1)
    with pytest.raises(DemonstrationError, match=message):
        is_done((*one, other), shared)
    assert not is_done((*one, other, "resume=false"), shared)
