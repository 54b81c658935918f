"""A signal of one's own, as CONTRIBUTING.md shows it: its code is run as it stands there."""

import re
import runpy

import torch
from recipe_runs import ROOT


def shown() -> str:
    """The recipe of the section."""
    section = (ROOT / "CONTRIBUTING.md").read_text().split("## Add a signal")[1].split("\n## ")[0]
    (code,) = re.findall(r"^```python\n(.*?)^```", section, re.MULTILINE | re.DOTALL)
    return code


def test_the_recipe_that_is_shown_pays_its_signal_and_has_it_judged(point_chain, tmp_path):
    file = tmp_path / "hand_high.py"
    file.write_text(shown())
    table = point_chain(
        "tstar", "system=hand_high", "chain.gate=false", "chain.links=2", "chain.rounds=1", file=file
    )
    assert table.groupby("skill").tsr_on_success.count().tolist() == [2, 0]  # the last skill has none
    assert table.hand_high_sd.notna().sum() == 1  # after the first skill's turn
    assert not [column for column in table if column.startswith("d_omega")]


def test_it_says_how_near_the_hand_is_to_a_height(tmp_path):
    file = tmp_path / "hand_high.py"
    file.write_text(shown())
    obs = torch.zeros(3, 72)
    obs[:, 18] = torch.tensor([0.12, 0.17, 0.32])
    said = runpy.run_path(str(file))["HandHigh"]().said(obs)
    torch.testing.assert_close(said, torch.tensor([[1.0], [0.5], [-1.0]]))
