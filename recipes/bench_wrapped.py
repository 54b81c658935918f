"""The part of `bench.py` that measures TorchRL's own wrapper around dm_control, on the same model."""

import time
from functools import partial

import numpy as np
from dm_env import specs
from torchrl.envs import DMControlWrapper, ParallelEnv

from tstar_envs.dm_physics import Physics  # dm_control's, and before the rest of it: it says how to draw
from tstar_envs.furniture import load
from tstar_envs.scene import SUBSTEPS, build_model

# isort: split
from dm_control.mujoco.wrapper import MjModel
from dm_control.rl import control


class BareTask(control.Task):
    """The least a dm_control task can be: positions and velocities out, controls in, no reward."""

    def initialize_episode(self, physics) -> None:
        """Nothing: the model's own start."""

    def before_step(self, action, physics) -> None:
        """Sets the controls."""
        physics.set_control(action)

    def after_step(self, physics) -> None:
        """Nothing."""

    def action_spec(self, physics) -> specs.BoundedArray:
        """The controls' own limits."""
        low, high = physics.model.actuator_ctrlrange.T
        return specs.BoundedArray(low.shape, np.float64, low, high)

    def get_observation(self, physics) -> dict[str, np.ndarray]:
        """Positions and velocities."""
        return {"qpos": physics.data.qpos.copy(), "qvel": physics.data.qvel.copy()}

    def get_reward(self, physics) -> float:
        """Zero."""
        return 0.0


def make_wrapped(task: str) -> DMControlWrapper:
    """TorchRL's wrapper around dm_control's environment, on the model that everything here runs on."""
    physics = Physics.from_model(MjModel(build_model(load(task))))
    return DMControlWrapper(control.Environment(physics, BareTask(), n_sub_steps=SUBSTEPS))


def wrapped_rate(task: str, workers: int, steps: int) -> float:
    """Control steps a second of `workers` wrapped environments, on random actions."""
    env = make_wrapped(task) if workers == 1 else ParallelEnv(workers, partial(make_wrapped, task))
    env.rollout(10)
    began = time.perf_counter()
    env.rollout(steps)
    rate = steps * workers / (time.perf_counter() - began)
    env.close()
    return rate
