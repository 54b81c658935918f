"""How fast on a GPU, against the number of simulations: bare, with the task, training; its time split; and memory.

`bench.py` calls this. `gpu_bare_N` is the simulator alone: control steps under random controls, without resets.
`gpu_env_N` is the environment on random actions, resets and all; `gpu_train_N` the loop of `gail_ppo.py` after its warm
start. `gpu_share_*` is what each part of that loop takes of it, at the largest number.
"""

import time
from collections.abc import Callable, Iterator
from typing import Any

import torch
from omegaconf import DictConfig, OmegaConf

from tstar_envs.scene import SUBSTEPS
from tstar_rl.config.build import environment
from tstar_rl.seeds import derive_seed

STEPS = "environment steps / s"


def device_rows(config: DictConfig, prepare: Callable[[DictConfig, Any], Any]) -> Iterator[dict[str, Any]]:
    """Rows of bench.csv, for each of bench.device_sizes, each as soon as it is measured.

    Args:
        config: of a recipe, with the device to measure and a scale that suits it.
        prepare: a config and an environment -> `bench_training.Training`, warm started.
    """
    steps, sizes = config.bench.steps, config.bench.device_sizes
    for number in sizes:
        own = OmegaConf.merge(config, {"training": {"num_envs": number}})
        free = _free(config.device)
        seed, limit = derive_seed(own.seed, "train"), own.training.max_steps
        env = environment(own, own.subtask, number, seed, max_steps=limit)
        if free is not None:
            taken = (free - _free(config.device)) / number
            yield _row(f"gpu_memory_{number}", taken, "bytes / simulation")
        bare = _bare_rate(env, steps)
        yield _row(f"gpu_bare_{number}", bare, STEPS, 1.0)
        rate = _environment_rate(env, steps)
        yield _row(f"gpu_env_{number}", rate, STEPS, rate / bare)
        training = prepare(own, env)
        _parts(training, 1)  # compiles, and lets the simulations drift apart
        seconds = _parts(training, config.bench.updates)
        rate = config.bench.updates * number * own.training.horizon / sum(seconds.values())
        yield _row(f"gpu_train_{number}", rate, STEPS, rate / bare)
        if number == sizes[-1]:
            whole = sum(seconds.values())
            for name, part in seconds.items():
                yield _row(f"gpu_share_{name}", part / whole, "of training")
        training.collection.close()


def _row(measure: str, value: float, unit: str, ratio: float = float("nan")) -> dict[str, Any]:
    return {"measure": measure, "value": round(value, 3), "unit": unit, "ratio_to_bare": round(ratio, 3)}


def _free(device: str) -> int | None:
    """Bytes of the device that are free, None where it is not a GPU."""
    if not device.startswith("cuda"):
        return None
    torch.cuda.synchronize()
    torch.cuda.empty_cache()
    return torch.cuda.mem_get_info()[0]


def _timed(work: Callable[..., Any], *arguments: Any, **named: Any) -> tuple[float, Any]:
    """Seconds until the device is done with some work, and what that gave."""
    if torch.cuda.is_available():
        torch.cuda.synchronize()
    began = time.perf_counter()
    given = work(*arguments, **named)
    if torch.cuda.is_available():
        torch.cuda.synchronize()
    return time.perf_counter() - began, given


@torch.no_grad()
def _bare_rate(env: Any, steps: int) -> float:
    """Control steps a second of the simulator."""
    physics = env.base_env.world.physics
    controls = physics.ctrl.clone()

    def work() -> None:
        for _ in range(steps):
            physics.ctrl.copy_(controls + 0.1 * torch.randn_like(controls))
            physics.step(SUBSTEPS)

    env.reset()
    work()  # records graphs
    return steps * env.batch_size.numel() / _timed(work)[0]


@torch.no_grad()
def _environment_rate(env: Any, steps: int) -> float:
    """Control steps a second of the environment on random actions, resets included."""

    def work() -> None:
        tensordict = env.reset()
        for _ in range(steps):
            action = torch.rand(*env.batch_size, 9, device=env.device) * 2 - 1
            _, tensordict = env.step_and_maybe_reset(tensordict.set("action", action))

    work()
    return steps * env.batch_size.numel() / _timed(work)[0]


def _parts(training: Any, iterations: int) -> dict[str, float]:
    """Seconds that each part of a training's iterations takes."""
    spent = {"collection": 0.0, "f_phi": 0.0, "rewards": 0.0, "ppo": 0.0}
    for _ in range(iterations):
        seconds, rollout = _timed(training.collection.rollout)
        spent["collection"] += seconds
        observations = {"expert": training.expert.observations, "agent": rollout["observation"]}
        spent["f_phi"] += _timed(training.update_f_phi, **observations)[0]
        spent["rewards"] += _timed(training.reward, rollout)[0]
        spent["ppo"] += _timed(training.update_policy, rollout, 0.0)[0]
    return spent
