"""The recipe that follows a chain skill by skill: what each is handed, and how it does from there."""

import pandas as pd

from tstar_rl.chaining.chain import save_chain


def test_a_skill_that_fails_where_the_one_before_ends_is_told_from_those_that_do_not(
    call, tmp_path, point_skills
):
    """From its own starts every skill succeeds. Skill 0 ends on both sides of y = 0, and skill 1 fails below."""
    save_chain(point_skills, tmp_path / "runs/table_lack/tstar/seed0/last")
    places = [f"{place}_dir={tmp_path / place}" for place in ("results", "runs")]
    for _ in range(2):  # its own rows are replaced
        call("hand_over", "systems=[tstar]", "+env.max_steps=20", "evaluation.episodes=64", *places)
    table = pd.read_csv(tmp_path / "results/table_lack/hand_over.csv")
    assert table.subtask.tolist() == [0, 1, 2, 3] and (table.own_starts == 1.0).all()
    reached = round(64 * table.handed_over[1])
    assert 16 < reached < 48
    assert table.handed.tolist() == [0, 64, reached, reached]
    assert table.handed_over.isna().tolist() == [True, False, False, False]
    assert table.handed_over[2:].tolist() == [1.0, 1.0]
    assert (table.handed_over_low[1:] < table.handed_over[1:]).all()
