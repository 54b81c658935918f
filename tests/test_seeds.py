"""No two purposes share a seed, and seeds are those of what is published."""

import pytest

from tstar_rl.rollouts.episodes import MODES
from tstar_rl.seeds import EVALUATIONS, PURPOSES, derive_seed, evaluation_seed


def test_seeds_of_different_purposes_differ():
    seeds = {derive_seed(0, purpose, 1) for purpose in ("train", "validate", "evaluate")}
    assert len(seeds) == 3 and derive_seed(0, "train", 1) in seeds and derive_seed(1, "train", 1) not in seeds
    with pytest.raises(ValueError, match="purpose must be one of"):
        derive_seed(0, "testing")


def test_seeds_are_those_of_what_is_published():
    """Another order of purposes or of evaluations would begin episodes that no table here was made of."""
    found = {purpose: derive_seed(0, purpose, 1) for purpose in PURPOSES}
    assert found == {
        "train": 1683718082, "validate": 901243215, "harvest": 1961547765, "evaluate": 1531785293,
        "demonstrate": 2040376534, "networks": 1565899405, "updates": 1749781631, "chain": 663341227,
        "export": 1024449490, "collect": 1951628595,
    }  # fmt: skip
    assert {what: evaluation_seed(0, what, None) for what in EVALUATIONS} == {
        "deterministic": 1805699211, "stochastic": 359558238, "hand_over": 529155087, "own_starts": 383253902,
        "chain": 675086157, "influence": 729609053, "exchange": 605756676, "ways_home": 313924044,
        "moved_parts": 41251332, "latents": 49722910, "parity": 1609591080,
    }  # fmt: skip


def test_seeds_depend_on_the_index_alone():
    assert derive_seed(0, "evaluate", 0, None) == derive_seed(0, "evaluate", 0, 99)
    assert derive_seed(0, "train") == derive_seed(0, "train", 0) == derive_seed(0, "train", 0, 0)


@pytest.mark.parametrize("wrong", [(-1,), (2**32,), (1.5,), (1, 2**32), (1, -1), (1, 0.5)])
def test_numbers_whose_seeds_would_be_those_of_others_are_refused(wrong):
    """numpy's words are of 32 bits: seed 2**32 would be seed 0 of the purpose after."""
    seed, *index = wrong
    with pytest.raises(ValueError, match=r"must be a whole number from 0 to 2\*\*32 - 1, got"):
        derive_seed(seed, "train", *index)


def test_what_is_evaluated_has_seeds_of_its_own():
    assert list(EVALUATIONS[: len(MODES)]) == list(MODES), "published tables are of these seeds"
    assert len({evaluation_seed(0, what, 2) for what in EVALUATIONS}) == len(EVALUATIONS)
    assert evaluation_seed(0, "hand_over", 2) == derive_seed(0, "evaluate", 2, 2)
    with pytest.raises(ValueError, match="an evaluation is one of .*hand_over.*; got 'film'"):
        evaluation_seed(0, "film")
