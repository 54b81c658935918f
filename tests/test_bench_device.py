"""The rows that a GPU adds to the bench, measured on the CPU: which there are, and what they stand in relation to."""

from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir

from tstar_rl.configuration import CONFIGS

RECIPES = Path(__file__).resolve().parent.parent / "recipes"
SMALL = [
    "training.horizon=4",
    "subtask=0",
    "ppo.minibatch=8",
    "bench.steps=2",
    "bench.device_sizes=[2,4]",
    "bc.epochs=1",
]


def test_every_size_has_its_rows_and_the_shares_are_of_one_whole(monkeypatch):
    monkeypatch.syspath_prepend(RECIPES)
    from bench import Training, warm_started
    from bench_device import device_rows

    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/bench", [*SMALL, "scale=gpu", "device=cpu", "nthread=1"])
    skill, expert = warm_started(config, 0)
    rows = device_rows(config, lambda own, env: Training(own, skill, expert, env, 0))
    rows = {row["measure"]: row for row in rows}
    parts = [f"gpu_share_{name}" for name in ("collection", "f_phi", "rewards", "ppo")]
    assert list(rows) == [f"gpu_{kind}_{n}" for n in (2, 4) for kind in ("bare", "env", "train")] + parts
    assert sum(rows[part]["value"] for part in parts) == pytest.approx(1.0, abs=0.01)
    for n in (2, 4):
        assert rows[f"gpu_bare_{n}"]["ratio_to_bare"] == 1.0
        ratio = rows[f"gpu_env_{n}"]["value"] / rows[f"gpu_bare_{n}"]["value"]
        assert rows[f"gpu_env_{n}"]["ratio_to_bare"] == pytest.approx(ratio, abs=0.01)
