"""Which trainings may go on to more steps than they were given, and what older ones noted otherwise."""

import pytest

from tstar_rl.runs.mismatch import as_begun, known_then

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
        asked(20, ppo={}),  # PPO's own default
        asked(20, from_checkpoint="last"),  # a chain's steps are those of its rounds
        asked(10),
        asked(9),
    ],
)
def test_another_is_held_against_what_it_was_given(other):
    assert as_begun(BEGUN, other) == other


@pytest.mark.parametrize("recipe", ["spirl", "gail_ppo"])
def test_only_spirl_noted_a_running_normaliser_that_it_did_not_have(recipe):
    saved, now = ({"recipe": recipe, "normalizer": {"running": on, "floor": 0.1}} for on in (True, False))
    other = {"recipe": recipe, "normalizer": {"running": False, "floor": 0.2}}
    assert known_then(saved, now) == (saved if recipe == "spirl" else now)
    assert known_then(saved, other)["normalizer"]["floor"] == 0.2
    assert known_then({"recipe": recipe}, now) == now


def test_a_run_that_noted_no_recipe_and_no_furniture_is_held_against_none():
    assert known_then({}, {"recipe": "bc", "furniture": "0" * 64, "seed": 0}) == {"seed": 0}
