"""A chain that is killed and resumed writes the table of one that was not."""

import pandas as pd
import pytest
import torch

from tstar_rl.chaining.chain import load_chain


def test_what_a_chain_carries_over_goes_on_after_a_kill(whole_and_resumed, tmp_path):
    """A run that is killed and resumed writes the same table as one that was not; whose turn it is comes back, too."""
    values = (
        "chain.gate=true",
        "chain.rounds=2",
        "chain.links=3",
        "chain.order=costliest",
        "chain.carry_over=true",
    )
    whole, resumed = whole_and_resumed("tstar", *values)
    assert whole.skill[3] != 0  # where the skills have turns in their order, this one is the first's
    pd.testing.assert_frame_equal(resumed, whole)
    places = [tmp_path / f"runs/table_lack/{system}/seed0/last" for system in ("whole", "cut")]
    for one, other in zip(*map(load_chain, places), strict=True):
        assert all(torch.equal(v, other.policy.state_dict()[k]) for k, v in one.policy.state_dict().items())


COARSE = ("+d_omega.bfloat16=true", "d_omega.steps=2", "d_omega.minibatch=32")
"""Few and small steps: where a processor has no such numbers, they are slow."""


@pytest.mark.slow
def test_a_signal_in_bfloat16_pays_the_same_after_a_kill(whole_and_resumed):
    """Killed in skill 0's second turn, which the d_omega pays that skill 1 has trained and has not made again."""
    values = (
        "chain.gate=false",
        "chain.links=3",
        "chain.rounds=2",
        "chain.d_omega_of=own",
        "chain.steps_per_turn=512",
        *COARSE,
    )
    whole, resumed = whole_and_resumed("tstar", *values)
    assert whole.tsr_on_success.notna().any()
    pd.testing.assert_frame_equal(whole, resumed)


@pytest.mark.slow
def test_a_further_network_in_bfloat16_is_resumed(whole_and_resumed):
    """A resumed chain is loaded before its skills, which have no d_seams until then."""
    values = ("chain.gate=false", "chain.links=3", "chain.rounds=2", "chain.steps_per_turn=512", *COARSE)
    whole, resumed = whole_and_resumed("scar_like", *values)
    assert whole.tsr_on_success.notna().any()
    pd.testing.assert_frame_equal(whole, resumed)


def test_a_chain_that_is_killed_twice_goes_on_to_the_same_figures(whole_and_resumed):
    """Between the kills skill 0 has its turn; what skills 1 and 2 carry over waits in two checkpoints."""
    values = ("chain.gate=false", "chain.rounds=2", "chain.links=3")
    whole, resumed = whole_and_resumed("tstar", *values, kills=(3, 4))
    pd.testing.assert_frame_equal(resumed, whole)
