"""One simulation of an assembly task as a `dm_env.Environment`: the batched environment with N = 1.

env = tstar_envs.load_dm("table_lack", subtask=0, seed=0)
step = env.reset()
while not step.last():
    step = env.step(policy(step.observation))
"""

from __future__ import annotations

from typing import Any

import dm_env
import numpy as np
import torch
from dm_env import specs
from tensordict import TensorDict

from tstar_envs.environment import BatchedEnvironment
from tstar_envs.tasks.actions import NUM_ACTIONS

_INDICES = ("subtask", "phase", "completed")


class DmEnvironment(dm_env.Environment):
    """An assembly task with numpy arrays in and out, float64.

    The observation is a dict: `observation` (O,), and `subtask`, `phase` and `completed` as integers. The discount
    is 0 where the task ended (success or failure) and 1 otherwise, also where the time limit cut the episode.
    From the same snapshot, the same actions give the same bits as in the batched environment.
    """

    def __init__(self, world: BatchedEnvironment):
        if world.num_sims != 1:
            raise ValueError(f"a dm_env.Environment is one simulation, got a world of {world.num_sims}")
        self.world = world
        self._begun = False

    def reset(self) -> dm_env.TimeStep:
        """Starts a new episode from the environment's own start."""
        self.world.reset()
        return self._restart()

    def reset_to(self, snapshot: TensorDict) -> dm_env.TimeStep:
        """Starts a new episode from a snapshot of batch [1], at the beginning of the subtask that it is at."""
        self.world.reset_to(snapshot)
        return self._restart()

    def step(self, action: np.ndarray) -> dm_env.TimeStep:
        """Takes one control step under `action` (9,); after the end of an episode, and at first, resets instead.

        Raises:
            ValueError: the action has another shape, or is NaN.
        """
        if not self._begun:
            return self.reset()
        values = np.asarray(action, dtype=np.float64)
        if values.shape != (NUM_ACTIONS,):
            raise ValueError(f"an action of {self.world.name} has shape ({NUM_ACTIONS},), got {values.shape}")
        self.world.step(torch.from_numpy(values).unsqueeze(0))
        state, task = self.world.state, self.world.task
        terminated, truncated = (bool(flag) for flag in task.get_termination(state))
        reward = float(task.get_reward(state))
        if not terminated and not truncated:
            return dm_env.transition(reward, self._observe())
        self._begun = False
        ends = dm_env.termination if terminated else dm_env.truncation
        return ends(reward, self._observe())

    def snapshot(self) -> TensorDict:
        """State of the simulation, batch [1]; see `tstar_envs.environment`."""
        return self.world.snapshot()

    @property
    def success(self) -> bool:
        """Whether the last step ended the episode in success."""
        return bool(self.world.state["success"])

    def action_spec(self) -> specs.BoundedArray:
        """Seven joint velocities, gripper, connect: (9,), values in [-1, 1]."""
        return specs.BoundedArray((NUM_ACTIONS,), np.float64, -1.0, 1.0, name="action")

    def observation_spec(self) -> dict[str, specs.Array]:
        """See the class."""
        numbers = {name: specs.Array((), np.int64, name=name) for name in _INDICES}
        return {
            "observation": specs.Array((self.world.num_observations,), np.float64, name="observation"),
            **numbers,
        }

    def _restart(self) -> dm_env.TimeStep:
        self._begun = True
        return dm_env.restart(self._observe())

    def _observe(self) -> dict[str, Any]:
        numbers = {name: self.world.state[name].squeeze(0).numpy().copy() for name in _INDICES}
        return {"observation": self.world.observation().squeeze(0).numpy(), **numbers}


def load_dm(task: str, subtask: int | None = None, seed: int | None = None, **settings: Any) -> DmEnvironment:
    """Returns an assembly task as a `dm_env.Environment`.

    Args:
        task: furniture, e.g. `table_lack`.
        subtask: step of the recipe, 0-based; None for the whole task.
        seed: of the start noise; None draws one.
        **settings: fields of `tstar_envs.settings.TaskSettings`.

    Raises:
        ValueError: unknown furniture, subtask or setting.
    """
    return DmEnvironment(BatchedEnvironment(task, 1, subtask, nthread=1, seed=seed, settings=settings))
