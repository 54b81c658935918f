"""How fast: bare simulator, environment, training, and TorchRL's wrapper around the same model. Writes bench.csv.

    python recipes/bench.py

`bare` is `mujoco.batch` stepping what the environment stepped: the same controls from the same states, resets not
timed. `env` is the environment on those random actions, resets and all; `train` is the loop of `gail_ppo.py`
after its warm start. `ratio_to_bare` is against the bare simulator under the same policy: `bare` (random actions)
for `env` and `torchrl_*`, `bare_policy` for `env_policy` and `train`. Where there is a GPU, see `bench_device.py` too.
"""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

os.environ.setdefault(
    "OMP_WAIT_POLICY", "passive"
)  # torch's idle threads must not hold the simulator's cores

import pandas as pd
import torch
from bench_device import device_rows
from bench_wrapped import wrapped_rate
from hydra import compose
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig
from tensordict import TensorDictBase
from tqdm import tqdm

from tstar_envs.physics.cpu import CpuPhysics
from tstar_envs.scene import SUBSTEPS
from tstar_rl.chaining.skill import Skill
from tstar_rl.config.build import environment, new_skill
from tstar_rl.config.load import recipe, settings
from tstar_rl.demonstrations.collect import collect
from tstar_rl.demonstrations.data_set import Demonstrations
from tstar_rl.rollouts.collection import Collection
from tstar_rl.runs.csv_tables import append_rows
from tstar_rl.seeds import derive_seed
from tstar_rl.transforms import GAILReward, RewardMixture, weighted
from tstar_rl.updates import (
    BehaviourCloningSettings,
    DiscriminatorSettings,
    DiscriminatorUpdate,
    PolicyUpdate,
    PPOSettings,
    behaviour_cloning,
)


@dataclass(frozen=True)
class BenchSection:
    """The section `bench` of `configs/recipe/bench.yaml`."""

    steps: int
    rounds: int
    updates: int
    workers: tuple[int, ...]
    worker_steps: int
    device_sizes: tuple[int, ...]


class Replay:
    """What the simulators of an environment were told in `steps` steps of a policy, to tell it to bare ones.

    Attributes:
        start: states and weld poses before the first step.
        controls: of each step, (N, nu).
        restarts: of each step, None or (which simulations began anew, states, weld poses).
    """

    def __init__(self, env, policy: Callable, steps: int) -> None:
        self.world = world = env.base_env.world
        tensordict = env.reset()
        self.start = self._rows()
        self.controls, self.restarts = [], []
        for _ in range(steps):
            tensordict = policy(tensordict)
            world.task.before_step(world.state, tensordict["action"].double().clamp(-1, 1))
            self.controls.append(world.physics.ctrl.clone())
            stepped, tensordict = env.step_and_maybe_reset(tensordict)
            done = stepped["next", "done"].squeeze(-1)
            self.restarts.append((done, *self._rows()) if done.any() else None)

    def _rows(self):
        return self.world.physics.state(), self.world.physics.eq_data.clone()

    def rate(self, nthread: int) -> float:
        """Control steps a second of bare `mujoco.batch`; restarts are not timed."""
        physics = CpuPhysics(self.world.model, self.world.num_sims, nthread)
        physics.set_state(*self.start)
        spent = 0.0
        for controls, restart in zip(self.controls, self.restarts, strict=True):
            began = time.perf_counter()
            physics.ctrl[:] = controls
            physics.batch.step(nstep=SUBSTEPS)
            spent += time.perf_counter() - began
            if restart is not None:
                done, states, welds = restart
                physics.set_state(states, welds, done)
        return len(self.controls) * self.world.num_sims / spent


@torch.no_grad()
def environment_rate(env, policy: Callable, steps: int) -> float:
    """Control steps a second of the environment, resets and `policy` included."""
    tensordict = env.reset()
    began = time.perf_counter()
    for _ in range(steps):
        _, tensordict = env.step_and_maybe_reset(policy(tensordict))
    return steps * env.batch_size.numel() / (time.perf_counter() - began)


def random_policy(generator: torch.Generator, tensordict: TensorDictBase) -> TensorDictBase:
    """Uniform actions (N, 9)."""
    action = torch.rand(*tensordict.batch_size, 9, generator=generator) * 2 - 1
    return tensordict.set("action", action)


def warm_started(config: DictConfig, seed: int) -> tuple[Skill, Demonstrations]:
    """A skill cloned from a few noise-injected demonstrations, so that it meets the contacts that training meets."""

    def make(s: int):
        return environment(config, config.subtask, 64, s, snapshots=True)

    expert = collect(make, 64, "noisy", config.demonstrations.noise, seed).to(config.device)
    skill = new_skill(config, config.subtask)
    skill.normalizer.fit(expert.observations, config.normalizer.floor)
    cloning = settings(BehaviourCloningSettings, config.bc)
    behaviour_cloning(skill.policy, expert.observations, expert.actions, cloning, seed)
    return skill, expert


class Training:
    """GAIL+PPO end to end, one iteration at a time: the loop of `gail_ppo.py`."""

    def __init__(self, config: DictConfig, skill: Skill, expert: Demonstrations, env, seed: int) -> None:
        self.expert = expert
        labels, f_phi = {"expert": 1.0, "agent": -1.0}, settings(DiscriminatorSettings, config.f_phi)
        self.update_f_phi = DiscriminatorUpdate("f_phi", skill.f_phi, labels, f_phi, seed)
        ppo = settings(PPOSettings, config.ppo)
        self.update_policy = PolicyUpdate(skill.policy, skill.value, ppo, skill.return_scale, seed)
        self.reward = weighted(settings(RewardMixture, config.reward), {"gail": GAILReward(skill.f_phi)})
        self.collection = Collection(env, skill.policy, config.training.horizon)

    def rate(self, iterations: int) -> float:
        """Control steps a second."""
        steps, began = 0, time.perf_counter()
        for _ in range(iterations):
            rollout = self.collection.rollout()
            steps += rollout.numel()
            self.update_f_phi(expert=self.expert.observations, agent=rollout["observation"])
            self.update_policy(self.reward(rollout), 0.0)
        return steps / (time.perf_counter() - began)


@recipe("bench", bench=BenchSection)
def main(config: DictConfig) -> None:
    """Measures, prints and writes <results_dir>/bench.csv."""
    bench, seed = config.bench, derive_seed(config.seed, "train")
    torch.manual_seed(seed)
    env = environment(
        config, config.subtask, config.training.num_envs, seed, max_steps=config.training.max_steps
    )
    rates: dict[str, list[float]] = {}
    rounds = tqdm(total=2 * bench.rounds + 1 + len(bench.workers), disable=not config.progress_bar)

    def note(**measured: float) -> None:
        for name, rate in measured.items():
            rates.setdefault(name, []).append(rate)
        rounds.update()

    act = partial(random_policy, torch.Generator().manual_seed(seed))
    replay = Replay(env, act, bench.steps)
    note(bare_one_thread=replay.rate(1))
    for _ in range(bench.rounds):
        note(bare=replay.rate(config.nthread), env=environment_rate(env, act, bench.steps))
    skill, expert = warm_started(config, seed)
    with torch.no_grad():
        replay = Replay(env, skill.policy, bench.steps)
    trained = environment(
        config, config.subtask, config.training.num_envs, seed, max_steps=config.training.max_steps
    )
    training = Training(config, skill, expert, trained, seed)
    training.rate(2)  # the first rollouts begin with all simulations at their start
    for _ in range(bench.rounds):
        note(
            bare_policy=replay.rate(config.nthread),
            env_policy=environment_rate(env, skill.policy, bench.steps),
            train=training.rate(bench.updates),
        )
    for workers in bench.workers:
        name = f"torchrl_parallel_{workers}" if workers > 1 else "torchrl_one"
        note(**{name: wrapped_rate(config.task.name, workers, bench.worker_steps)})
    rounds.close()
    path = Path(config.results_dir) / "bench.csv"
    write(rates, path)
    for row in on_a_gpu(HydraConfig.get().overrides.task):
        print(row)
        append_rows(path, [row], ("measure",))  # at once: the largest number may not fit
    print(path)


def on_a_gpu(given: Sequence[str]) -> Iterator[dict[str, Any]]:
    """The rows of a GPU, where there is one: at its own scale, with the other values that were given."""
    own = compose(
        "recipe/bench", ["scale=gpu", *(value for value in given if not value.startswith("scale="))]
    )
    if not (torch.cuda.is_available() and own.device.startswith("cuda")):
        print(
            "No CUDA device: the rows gpu_* (steps/s against N, training, time split, memory) are left out."
        )
        return
    seed = derive_seed(own.seed, "train")
    skill, expert = warm_started(own, seed)
    yield from device_rows(own, lambda sized, env: Training(sized, skill, expert, env, seed))


def write(rates: dict[str, list[float]], path: Path) -> None:
    """Writes the medians, each with its ratio to the bare simulator under the same policy."""
    middle = {name: median(values) for name, values in rates.items()}
    against = {
        name: "bare_policy" if name.endswith("policy") or name == "train" else "bare" for name in middle
    }
    table = pd.DataFrame(
        {
            "measure": list(middle),
            "value": [round(rate, 1) for rate in middle.values()],
            "unit": "environment steps / s",
            "ratio_to_bare": [round(rate / middle[against[name]], 3) for name, rate in middle.items()],
        }
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    table.to_csv(path, index=False)
    print(table.to_string(index=False))


if __name__ == "__main__":
    main()
