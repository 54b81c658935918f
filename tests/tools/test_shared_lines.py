"""Lines that recipes share, counted on two that are worked by hand, and the limit that all systems keep."""

import pytest
import shared_lines as tool

MOST = 15
ONE = '''"""Says what it does."""
import torch


@recipe("one")
def main(config):
    """Trains.

    In two lines.
    """
    # why
    run = Run(config)  # what
    for rollout in run:
        run.log(rollout)

    text = "# no comment"
    run.log(rollout)


if __name__ == "__main__":
    main()
'''
OTHER = """import torch
def main(config):
    run = Run(config)
    run.log(
        rollout
    )
    run.log(rollout)
    run.log(rollout)
    run.log(rollout)
"""


def test_what_counts_as_a_line():
    assert tool.code_lines(ONE) == [
        "def main(config):",
        "run = Run(config)",
        "for rollout in run:",
        "run.log(rollout)",
        'text = "# no comment"',
        "run.log(rollout)",
        'if __name__ == "__main__":',
        "main()",
    ]
    assert len(tool.code_lines(OTHER)) == 8
    with pytest.raises(ValueError, match="no function is called main"):
        tool.code_lines("import torch")


def test_a_line_is_shared_as_often_as_it_stands_in_both():
    one, other = tool.code_lines(ONE), tool.code_lines(OTHER)
    assert tool.shared_lines(one, other) == tool.shared_lines(other, one) == 4  # of run.log(rollout) two


def test_no_two_systems_share_more_lines_than_they_may():
    shared = tool.table()
    assert {name for pair in shared for name in pair} == set(tool.SYSTEMS)
    too_many = {pair: n for pair, n in shared.items() if pair[0] != pair[1] and n > MOST}
    assert not too_many, "bookkeeping belongs to skill_training and chain_turns"


def test_every_recipe_that_trains_is_counted():
    trains = ("chain_turns(config)", "skill_training(config)")
    recipes = {path.stem: path.read_text() for path in tool.RECIPES.glob("*.py")}
    training = {name for name, text in recipes.items() if any(call in text for call in trains)}
    assert {"gail_ppo", "tstar"} <= training
    assert training <= set(tool.SYSTEMS), (
        "name it in FINE_TUNING or ONE_POLICY of tstar_rl/config/recipe_kinds.py"
    )


def test_the_command_prints_every_pair(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["shared_lines.py", "gail", "tstar"])
    tool.main()
    said = capsys.readouterr().out.splitlines()
    shared = tool.table(("gail", "tstar"))
    assert said[0].split() == ["gail", "tstar"] and said[1].split() == ["gail", str(shared["gail", "gail"])]
    assert said[2].split() == ["tstar", str(shared["gail", "tstar"]), str(shared["tstar", "tstar"])]
