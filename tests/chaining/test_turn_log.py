"""What a turn logs, on a chain that trains in seconds."""

import math
import re

import pandas as pd
import pytest

from tstar_rl.chaining import turns


def test_the_log_says_how_d_omega_does(point_chain, tmp_path):
    table = point_chain("tstar", "chain.gate=true", "chain.links=2", "d_omega.steps=256")
    ends = table.dropna(subset=["trial_progress"])
    assert ends.skill.tolist() == [0, 1] and (ends.trial_steps > 0).all()
    first = ends.iloc[0]
    assert first.handed == 64 and 0 < first.next_success < 1
    assert first.d_omega_auc > 0.9 and first.d_omega_sd > 0.05
    assert 0 < first.d_omega_brier < 1 and 0 < first.d_omega_ece < 1
    assert math.isnan(ends.iloc[1].d_omega_auc)
    curve = pd.read_csv(tmp_path / "results/table_lack/tstar/seed0/calibration.csv")
    assert set(curve.signal) == {"d_omega"} and curve.states.sum() == first.handed
    reached = (curve.outcome * curve.states).sum() / curve.states.sum()
    assert reached == pytest.approx(first.next_success), (
        "what is said is judged against what the next skill did"
    )


def test_a_d_omega_that_nothing_trains_is_not_judged(point_chain):
    table = point_chain("policy_sequencing", "chain.gate=true", "chain.links=2")
    assert "d_omega_auc" not in table and table.next_success.notna().sum() == 1


def test_a_d_omega_is_judged_once_it_was_trained_itself(point_chain):
    """Each turn trains its own skill's, as the paper does: in the first round, the next skill's is not trained yet."""
    values = ("chain.gate=false", "chain.links=3", "chain.rounds=2", "chain.d_omega_of=own")
    table = point_chain("tstar", *values, "chain.steps_per_turn=512")
    ends = table[table.handed.notna()]
    assert ends.skill.tolist() == [0, 1, 0, 1] and (ends.handed > 1).all()
    assert ends.d_omega_sd.notna().tolist() == [False, False, True, True]
    # Before that it pays nothing: what an untrained network says would be noise.
    paid = table[table.skill < 2].groupby(["round", "skill"]).tsr_on_success.max()
    assert paid.loc[0].tolist() == [0, 0] and (paid.loc[1] > 0).all()


def test_skills_whose_signals_no_trial_judges_are_told(point_chain, capsys):
    values = ("chain.gate=false", "chain.rounds=2", "chain.steps_per_turn=512")
    common = "trials after every 2 turns .* the number of skills, 2, have a factor in common"
    cases = ((2, 2, [], common), (2, 1, [0, 0], None), (3, 4, [0], "too few for all with 6 turns"))
    for links, every, judged, why in cases:
        own = (f"chain.links={links}", f"chain.trial_every={every}", f"system=every_{every}")
        table = point_chain("tstar", *values, *own)
        assert ("handed" in table) == bool(judged)
        assert not judged or table["skill"][table["handed"].notna()].tolist() == judged
        said = f"no trial follows a turn of skill {links - 2}, so their hand-overs and signals are not judged: .*{why}"
        assert (re.search(said, capsys.readouterr().out) is not None) == (why is not None)


def test_terminal_states_that_are_logged_are_those_the_skill_reached(point_chain, tmp_path, monkeypatch):
    monkeypatch.setattr(turns, "PARTS", 0)  # x and y in the place of poses
    short = ("chain.gate=false", "chain.steps_per_turn=512", "chain.trial_every=100", "chain.links=3")
    point_chain("tstar", *short, "chain.logged_skill=1", "chain.logged_states=5")
    table = pd.read_csv(tmp_path / "results/table_lack/tstar/seed0/terminal_states.csv")
    assert table.skill.tolist() == [1] * 5 and (table.env_steps == 1024).all()
    assert table.pose_0.between(2, 3).all() and (table.pose_1 > 0).all()  # where subtask 1 is done
