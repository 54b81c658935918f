"""The loop of docs/library.md, on TorchRL's own collector, buffer and losses, runs as it is written, made small."""

import re
from pathlib import Path

import torch

PAGE = Path(__file__).resolve().parents[2] / "docs" / "library.md"


def test_the_loop_of_the_page(monkeypatch):
    section = PAGE.read_text().split("## In a TorchRL loop of your own\n")[1].split("\n## ")[0]
    (code,) = re.findall(r"^```python\n(.*?)^```", section, re.MULTILINE | re.DOTALL)
    small, changed = re.subn(
        r"simulations, horizon, rollouts = .*", "simulations, horizon, rollouts = 4, 32, 2", code
    )
    assert changed == 1
    torch.manual_seed(0)
    found: dict = {}
    exec(compile(small, str(PAGE), "exec"), found)
    assert len(found["ends"]) >= 4  # where the script's episodes ended
    following = found["rollout"]["next"]
    paid = 0.05 * (
        0.5 * following["reward_env"] + 0.5 * following["reward_gail"] + 1e4 * following["reward_tsr"]
    )
    torch.testing.assert_close(following["reward"], paid)
    assert found["rollout"]["start_chained"].float().mean() > 0.3 and following["reward_gail"].mean() > 0
    torch.manual_seed(0)  # the skill as it was before the loop
    new = found["rl"].Skill("table_lack", 1, found["rl"].NetworkSettings())
    assert any(
        (a != b).any()
        for a, b in zip(found["skill"].policy.parameters(), new.policy.parameters(), strict=True)
    )
