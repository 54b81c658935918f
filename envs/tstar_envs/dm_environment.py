"""One simulation of an assembly task as dm_control's `Environment`, with its `Physics` and its `Task`.

env = tstar_envs.load_dm("table_lack", subtask=0, seed=0)
step = env.reset()
while not step.last():
    step = env.step(policy(step.observation))

dm_control's tools work on it: `dm_control.viewer`, `suite.wrappers.pixels`, `suite.wrappers.action_scale`. The task is
`tasks.assembly`, as under every front: its simulator is here the MjData of dm_control's physics (`physics.single`), so
`env.physics.data` is the simulation and not a copy.
"""

from __future__ import annotations

import copy
from typing import Any

import dm_env
import numpy as np
import torch
from dm_env import specs
from tensordict import TensorDict

from tstar_envs.dm_physics import AssemblyPhysics  # before dm_control: it says how to draw
from tstar_envs.environment import BatchedEnvironment
from tstar_envs.furniture import library
from tstar_envs.scene import SUBSTEPS, build_model
from tstar_envs.settings import TaskSettings
from tstar_envs.tasks.actions import NUM_ACTIONS, array_of_actions

# isort: split
from dm_control.mujoco.wrapper import MjModel
from dm_control.rl import control

_INDICES = ("subtask", "phase", "completed")


class AssemblyTask(control.Task):
    """The verbs of dm_control's tasks, each handed on to the world, which simulates with `physics.view`."""

    def __init__(self, world: BatchedEnvironment):
        self.world = world
        self._action = torch.zeros(1, NUM_ACTIONS, dtype=torch.float64)
        self._random_state: np.random.RandomState | None = None

    @property
    def _random(self) -> np.random.RandomState | None:
        """What start noise is seeded from, where somebody has set it, as TorchRL does: suite tasks have it."""
        return self._random_state

    @_random.setter
    def _random(self, state: np.random.RandomState) -> None:
        self._random_state = state
        self.world.seed(int(state.randint(2**31)))

    def initialize_episode(self, physics: AssemblyPhysics) -> None:
        """Starts a new episode from the environment's own start."""
        self.world.reset()

    @torch.inference_mode()
    def before_step(self, action: np.ndarray, physics: AssemblyPhysics) -> None:
        """Writes controls for `action` (9,).

        Raises:
            ValueError: it has another shape, or is NaN; no episode was begun.
        """
        values = array_of_actions(self.world.name, action, (NUM_ACTIONS,))
        physics.view.catch_up()  # what a user wrote into the data before this step; its controls are this action's
        self._action = self.world.before_step(values.unsqueeze(0))

    @torch.inference_mode()
    def after_step(self, physics: AssemblyPhysics) -> None:
        """Reads what the step did."""
        self.world.after_step(self._action, physics.tell_failed())

    def get_observation(self, physics: AssemblyPhysics) -> dict[str, Any]:
        """See `DmEnvironment`."""
        physics.view.catch_up()
        numbers = {name: self.world.state[name].squeeze(0).numpy().copy() for name in _INDICES}
        return {"observation": self.world.observation().squeeze(0).numpy(), **numbers}

    def get_reward(self, physics: AssemblyPhysics) -> float:
        """Reward of the last step."""
        return float(self.world.task.get_reward(self.world.state))

    def get_termination(self, physics: AssemblyPhysics) -> float | None:
        """None while the episode goes on; then the discount: 0 after success or failure, 1 at the time limit."""
        terminated, truncated = self.world.task.get_termination(self.world.state)
        if bool(terminated):
            return 0.0
        return 1.0 if bool(truncated) else None

    def action_spec(self, physics: AssemblyPhysics) -> specs.BoundedArray:
        """Seven joint velocities, gripper, connect: (9,), values in [-1, 1]."""
        return specs.BoundedArray((NUM_ACTIONS,), np.float64, -1.0, 1.0, name="action")

    def observation_spec(self, physics: AssemblyPhysics) -> dict[str, specs.Array]:
        """See `DmEnvironment`."""
        numbers = {name: specs.Array((), np.int64, name=name) for name in _INDICES}
        return {
            "observation": specs.Array((self.world.num_observations,), np.float64, name="observation"),
            **numbers,
        }


class DmEnvironment(control.Environment):
    """An assembly task with numpy arrays in and out, float64.

    The observation is a dict: `observation` (O,), and `subtask`, `phase` and `completed` as integers. The discount
    is 0 where the task ended (success or failure) and 1 otherwise, also where the time limit cut the episode.
    From the same snapshot, the same actions give the same bits as in the batched environment. A copy, by
    `copy.deepcopy` or pickle, is another simulation in the state of `snapshot`; its model is compiled anew from the
    furniture, so what was written into `physics.model` is not in it.
    """

    world: BatchedEnvironment

    def __init__(self, physics: AssemblyPhysics, task: AssemblyTask):
        super().__init__(physics, task, n_sub_steps=SUBSTEPS)
        self.world = task.world

    def reset(self) -> dm_env.TimeStep:
        """Starts an episode; where none can begin, the next step tries again, as after an end."""
        try:
            return super().reset()
        except BaseException:
            self._reset_next_step = True
            raise

    def reset_to(self, snapshot: TensorDict) -> dm_env.TimeStep:
        """Starts a new episode from a snapshot of batch [1], at the beginning of the subtask that it is at."""
        self.world.reset_to(snapshot)
        self._physics.tell_failed()  # of what was there before
        self._reset_next_step, self._step_count = False, 0
        return dm_env.restart(self._task.get_observation(self._physics))

    def snapshot(self) -> TensorDict:
        """State of the simulation, batch [1]; see `tstar_envs.environment`."""
        return self.world.snapshot()

    def __reduce__(self) -> tuple[Any, ...]:
        state = {
            "snapshot": self.snapshot(),
            "generator": self.world.generator.get_state(),
            "failures": self.world.failures,
            "random": self._task._random,
            "next": (self._reset_next_step, self._step_count),
        }
        return _again, (self.world.arguments, state)

    @property
    def success(self) -> bool:
        """Whether the last step ended the episode in success."""
        return bool(self.world.state["success"])


def make(task: str, subtask: int | None, seed: int | None, settings: dict[str, Any]) -> DmEnvironment:
    """See `registry.load_dm`."""
    chosen = TaskSettings.from_keywords("load_dm", settings)
    physics = AssemblyPhysics.from_model(MjModel(build_model(library.load(task))))
    world = BatchedEnvironment(task, 1, subtask, seed=seed, settings=chosen, physics=physics.view)
    return DmEnvironment(physics, AssemblyTask(world))


def _again(arguments: dict[str, Any], state: dict[str, Any]) -> DmEnvironment:
    """A copy, from what `DmEnvironment.__reduce__` gave."""
    task, subtask = arguments.pop("task"), arguments.pop("subtask")
    env = make(task, subtask, None, arguments)
    if state["random"] is not None:
        env.task._random_state = copy.deepcopy(state["random"])  # copy.copy(env) brings the original's own
    env.world.generator.set_state(state["generator"])
    env.world.restore(state["snapshot"])
    env.world.failures = state["failures"]
    env._reset_next_step, env._step_count = state["next"]
    return env
