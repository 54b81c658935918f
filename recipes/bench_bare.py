"""The part of the bench that measures the simulator, bare and in the environment, and one simulation in its fronts."""

import time
from collections.abc import Callable

import gymnasium
import numpy as np
import torch
from tensordict import TensorDictBase
from torch import Tensor

import tstar_envs
from tstar_envs.gymnasium_env import environment_id
from tstar_envs.physics.cpu import CpuPhysics
from tstar_envs.scene import SUBSTEPS


class Replay:
    """What the simulators of a world were told while something stepped it, to tell it to bare ones.

    Attributes:
        start: states and weld poses before the first step.
        controls: of each step, (N, nu).
        restarts: before each step, None or (which simulations began anew since the last, states, weld poses).

    Args:
        world: on the CPU; all its simulations step together.
        run: steps it.
    """

    def __init__(self, world, run: Callable[[], object]) -> None:
        self.world = world
        self.start = self._rows()
        self.controls, self.restarts = [], []
        physics = world.physics
        cleared = torch.zeros(world.num_sims, dtype=torch.bool)
        step, clear = physics.step, physics.clear

        def told_to_clear(mask: Tensor) -> None:
            cleared.logical_or_(mask)
            clear(mask)

        def told_to_step(substeps: int, mask: Tensor | None = None) -> Tensor:
            if mask is None:
                self.controls.append(physics.ctrl.clone())
                self.restarts.append((cleared.clone(), *self._rows()) if cleared.any() else None)
                cleared.zero_()
            return step(substeps, mask)

        physics.step, physics.clear = told_to_step, told_to_clear
        try:
            run()
        finally:
            del physics.step, physics.clear

    def _rows(self) -> tuple[Tensor, Tensor]:
        return self.world.physics.state(), self.world.physics.eq_data.clone()

    def rate(self, nthread: int) -> float:
        """Control steps a second of bare `mujoco.batch`; restarts are not timed."""
        physics = CpuPhysics(self.world.model, self.world.num_sims, nthread)
        return len(self.controls) * self.world.num_sims / self.tell(physics)

    def tell(self, physics: CpuPhysics) -> float:
        """Tells it all to other simulators; the seconds they stepped."""
        physics.set_state(*self.start)
        spent = 0.0
        for controls, restart in zip(self.controls, self.restarts, strict=True):
            if restart is not None:
                began_anew, states, welds = restart
                physics.set_state(states, welds, began_anew)
            began = time.perf_counter()
            physics.ctrl[:] = controls
            physics.batch.step(nstep=SUBSTEPS)
            spent += time.perf_counter() - began
        return spent


def replay(env, policy: Callable, steps: int) -> Replay:
    """What the simulators of an environment are told in `steps` steps of a policy from new episodes on."""
    return Replay(env.base_env.world, lambda: environment_rate(env, policy, steps))


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


def single_rates(task: str, subtask: int, steps: int, seed: int) -> dict[str, float]:
    """Control steps a second of one simulation in each front, and bare, on the same random actions from one start.

    Resets are not timed. The bare simulator is told the controls that the dm_env front was told.

    Args:
        task: furniture.
        subtask: 0-based.
        steps: timed in each front.
        seed: of the start and of the actions.
    """
    actions = np.random.default_rng(seed).uniform(-1, 1, (steps, 9)).astype(np.float32)
    env = gymnasium.make(environment_id(task), subtask=subtask)
    env.reset(seed=seed)
    spent = 0.0
    for action in actions:
        began = time.perf_counter()
        *_, terminated, truncated, _ = env.step(action)
        spent += time.perf_counter() - began
        if terminated or truncated:
            env.reset()
    env.close()
    return {"single_gymnasium": steps / spent} | _single_dm(task, subtask, actions, seed)


def _single_dm(task: str, subtask: int, actions: np.ndarray, seed: int) -> dict[str, float]:
    """Control steps a second of the dm_env front, and of a bare simulator that is told the same, in turn."""
    env = tstar_envs.load_dm(task, subtask=subtask, seed=seed)
    world = env.world
    bare = CpuPhysics(world.model, 1, 1)
    spent = {"single_dm": 0.0, "bare_single": 0.0}
    last = None
    for action in actions:
        if last is None or last.last():
            env.reset()
            bare.set_state(world.physics.state(), world.physics.eq_data)
        began = time.perf_counter()
        last = env.step(action)
        middle = time.perf_counter()
        bare.ctrl[:] = world.physics.ctrl
        bare.batch.step(nstep=SUBSTEPS)
        spent["bare_single"] += time.perf_counter() - middle
        spent["single_dm"] += middle - began
    return {name: len(actions) / seconds for name, seconds in spent.items()}
