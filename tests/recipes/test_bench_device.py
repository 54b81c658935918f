"""The rows that a GPU adds to the bench, measured on the CPU by a clock that is known."""

from pathlib import Path

import pytest
import torch
from hydra import compose, initialize_config_dir

from tstar_rl.config.values import CONFIGS

RECIPES = Path(__file__).resolve().parents[2] / "recipes"
SMALL = [
    "training.horizon=4",
    "subtask=0",
    "ppo.minibatch=8",
    "bench.steps=2",
    "bench.device_sizes=[2,4]",
    "bc.epochs=1",
]


class Clock:
    """Seconds that pass only in what is told to take them, however often it is called inside something else."""

    def __init__(self) -> None:
        self.now = 0.0

    def takes(self, seconds: float, work):
        def timed(*arguments, **named):
            began = self.now
            given = work(*arguments, **named)
            self.now = began + seconds
            return given

        return timed


def test_rates_and_shares_of_work_that_takes_known_times(monkeypatch):
    """A bare control step takes 1/4 s, one of the environment 1/2 s, an iteration of training 2 + 1 + 1/2 + 1/2 s."""
    monkeypatch.syspath_prepend(RECIPES)
    import bench_device
    from bench_training import Training, warm_started

    clock, make = Clock(), bench_device.environment
    monkeypatch.setattr(bench_device.time, "perf_counter", lambda: clock.now)

    def environment(*arguments, **named):
        env = make(*arguments, **named)
        physics = env.base_env.world.physics
        monkeypatch.setattr(physics, "step", clock.takes(0.25, physics.step))
        monkeypatch.setattr(env, "reset", clock.takes(0.0, env.reset))
        monkeypatch.setattr(env, "step_and_maybe_reset", clock.takes(0.5, env.step_and_maybe_reset))
        return env

    def prepare(config, env):
        training = Training(config, skill, expert, env, 0)
        parts = {"update_f_phi": 1.0, "reward": 0.5, "update_policy": 0.5}
        for name, seconds in parts.items():
            monkeypatch.setitem(vars(training), name, clock.takes(seconds, getattr(training, name)))
        monkeypatch.setattr(training.collection, "rollout", clock.takes(2.0, training.collection.rollout))
        return training

    monkeypatch.setattr(bench_device, "environment", environment)
    with initialize_config_dir(str(CONFIGS), version_base="1.3"):
        config = compose("recipe/bench", [*SMALL, "scale=gpu", "device=cpu", "nthread=1"])
    skill, expert = warm_started(config, 0)
    rows = {row["measure"]: row for row in bench_device.device_rows(config, prepare)}
    # N simulations make N / 0.25, N / 0.5 and, in rollouts of 4 steps, 4 N / 4 steps a second.
    rates = {"bare": (4.0, 1.0), "env": (2.0, 0.5), "train": (1.0, 0.25)}
    expected = {f"gpu_{kind}_{n}": (n * rate, of) for n in (2, 4) for kind, (rate, of) in rates.items()}
    shares = {"collection": 0.5, "f_phi": 0.25, "rewards": 0.125, "ppo": 0.125}
    measured = {
        name: (row["value"], row["ratio_to_bare"]) for name, row in rows.items() if "share" not in name
    }
    assert measured == expected
    assert {name: row["value"] for name, row in rows.items() if "share" in name} == {
        f"gpu_share_{name}": share for name, share in shares.items()
    }


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
