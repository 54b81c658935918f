"""Which trainings may go on to more steps than they were given."""

import pytest

from tstar_rl.runs.mismatch import as_begun

FREE = {"exploration": None, "networks": {"std": "fixed"}, "ppo": {"linear_decay": False}}
BEGUN = {**FREE, "training": {"total_steps": 10, "horizon": 2}}


def asked(steps: int, **values: object) -> dict[str, object]:
    return {**FREE, "training": {"total_steps": steps, "horizon": 2}, **values}


@pytest.mark.parametrize("values", [{}, {"exploration": {"arm": [0.1, 0.1]}, "networks": {"std": "state"}}])
def test_a_training_goes_on_to_more_steps(values):
    more = asked(20, **values)
    assert as_begun(BEGUN, more) == {**more, "training": {"total_steps": 10, "horizon": 2}}


def test_spirl_goes_on_to_more_of_its_own_steps_whatever_else_it_has():
    scheduled = {"ppo": {"linear_decay": True}, "training": {"total_steps": 99}}
    begun, more = ({**FREE, **scheduled, "spirl": {"total_steps": steps}} for steps in (10, 20))
    assert as_begun(begun, more) == begun
    assert as_begun(more, begun) == begun


@pytest.mark.parametrize(
    "other",
    [
        asked(20, exploration={"arm": [0.1, 0.1]}),  # a fixed deviation follows the share that is done
        asked(20, ppo={"linear_decay": True}),
        asked(20, from_checkpoint="last"),  # a chain's steps are those of its rounds
        asked(10),
        asked(9),
    ],
)
def test_another_is_held_against_what_it_was_given(other):
    assert as_begun(BEGUN, other) == other
