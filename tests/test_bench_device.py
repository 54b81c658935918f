"""The rows that a GPU adds to the bench, measured on the CPU: which there are, and what they stand in relation to."""

from pathlib import Path

import pytest
import torch
from hydra import compose, initialize_config_dir

from tstar_rl.config.load import CONFIGS

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
    from bench_device import device_rows
    from bench_training import Training, warm_started

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


def test_what_was_given_is_measured_and_every_row_is_there_at_once(monkeypatch):
    """A scale that was given is the processor's; the rest holds for the GPU too."""
    monkeypatch.syspath_prepend(RECIPES)
    import bench

    measured = []

    def too_large(config, prepare):
        measured.append(config)
        yield {"measure": "gpu_bare_2", "value": 1.0}
        raise torch.OutOfMemoryError

    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(bench, "warm_started", lambda config, seed: (None, None))
    monkeypatch.setattr(bench, "device_rows", too_large)
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        rows = bench.on_a_gpu(["scale=laptop", "bench.device_sizes=[2]", "seed=3", "ppo.compile=default"])
        assert next(rows)["measure"] == "gpu_bare_2"
        (config,) = measured
        assert (config.bench.device_sizes, config.seed, config.ppo.compile) == ([2], 3, "default")
        assert config.device == "cuda" and config.f_phi.minibatch == 2048  # of scale=gpu
        with pytest.raises(torch.OutOfMemoryError):
            next(rows)
        assert list(bench.on_a_gpu(["device=cpu"])) == []
