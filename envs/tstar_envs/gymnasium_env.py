"""The assembly tasks in Gymnasium: one simulation as a `gymnasium.Env`, and an id for each piece of furniture.

    import gymnasium, tstar_envs  # the import registers the ids

    env = gymnasium.make("tstar/TableLack-v0", subtask=0)
    envs = gymnasium.make_vec("tstar/TableLack-v0", num_envs=64, subtask=0)  # see `gymnasium_vector_env`

Gymnasium 1 looks for no plugins, so either the import or an id that names it, `"tstar_envs:tstar/TableLack-v0"`.
"""

from __future__ import annotations

import warnings
from typing import Any

import gymnasium
import numpy as np
from tensordict import TensorDict

from tstar_envs.checks import finite_number
from tstar_envs.environment import BatchedEnvironment
from tstar_envs.furniture import FurnitureError, library
from tstar_envs.gymnasium_shared import INFO, METADATA, Camera, begin, read_options, spaces, world_seed
from tstar_envs.settings import TaskSettings
from tstar_envs.tasks.actions import NUM_ACTIONS, array_of_actions


def environment_id(furniture: str) -> str:
    """Gymnasium's id of a task, in its camel case: `table_lack` is `tstar/TableLack-v0`."""
    return f"tstar/{library.camel_case(furniture)}-v0"


def register() -> None:
    """Gives Gymnasium an id for every piece of furniture in the library; those it has are left alone.

    Warns of pieces that get no id: all further ones, if `library.FURTHER` names what is no folder; and the second of
    two pieces whose ids would be the same, such as `stool_1` and `stool1`.
    """
    try:
        names = library.names()
    except FurnitureError as error:
        warnings.warn(f"Gymnasium has ids of the package's own furniture alone: {error}", stacklevel=2)
        names = library.names((library.DATA,))
    for name in names:
        known = gymnasium.registry.get(environment_id(name))
        if known is not None and (other := known.kwargs.get("task", name)) != name:
            warnings.warn(
                f"{name!r} and {other!r} have the same id, {known.id}, which stays the second's: rename the first",
                stacklevel=2,
            )
        if known is None:
            gymnasium.register(
                environment_id(name),
                entry_point="tstar_envs.gymnasium_env:GymnasiumEnv",
                vector_entry_point="tstar_envs.gymnasium_vector_env:GymnasiumVectorEnv",
                kwargs={"task": name},
            )


class GymnasiumEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """An assembly task with numpy arrays in and out.

    Observation (O,) and action (9,) are float32, actions are clipped to [-1, 1]. An episode is terminated by success
    or failure and truncated by the task's own limit (`max_steps` of the settings): no `TimeLimit` is needed. `info`
    has `success` (bool), `subtask`, `phase` and `completed` (int). From the same snapshot, the same actions give the
    same numbers as in the other fronts. `reset(seed=...)` seeds the start noise, a first `reset()` draws a seed, which
    is `np_random_seed`;
    `reset(options={"snapshot": ...})` starts from a snapshot of batch [1], at the beginning of the subtask it is at.

    Args:
        task: furniture, e.g. `table_lack`; `gymnasium.make` fills it in.
        subtask: step of the recipe, 0-based; None for the whole task.
        reward_scale: factor of the reward. The default 1 is the reward that every front gives; the paper's
            policies see it times 0.05.
        render_mode: `rgb_array`, or None.
        width: of an image, pixels.
        height: of an image, pixels.
        **settings: fields of `tstar_envs.settings.TaskSettings`.

    Raises:
        ValueError: unknown furniture, subtask or render mode; a setting, reward scale or size that cannot be.
        TypeError: a keyword that is no setting.
    """

    metadata = METADATA

    def __init__(
        self, task: str, subtask: int | None = None, reward_scale: float = 1.0, render_mode: str | None = None,
        width: int = 640, height: int = 480, **settings: Any,
    ):  # fmt: skip
        chosen = TaskSettings.from_keywords(type(self).__name__, settings)
        self.world = BatchedEnvironment(task, 1, subtask, nthread=1, settings=chosen)
        self.observation_space, self.action_space = spaces(self.world)
        self.reward_scale, self.render_mode = finite_number("reward_scale", reward_scale), render_mode
        self._camera = Camera(self.world, render_mode, width, height)
        self._playing = self._seeded = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Starts an episode.

        Raises:
            ValueError: an unknown option, or a snapshot of another batch or subtask.
        """
        snapshot = read_options(self.world, options, ("snapshot",)).get("snapshot")
        drawn = world_seed(self, seed, first=not self._seeded)
        # Where no episode can begin, there is none to step; a snapshot that is refused leaves the one under way.
        self._playing = self._playing and snapshot is not None
        begin(self.world, drawn, snapshot)
        super().reset(seed=seed)
        self._seeded = True
        self._playing = True
        return self._observe()

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """One control step, 0.1 s.

        Raises:
            ValueError: the action has another shape, or is NaN.
            gymnasium.error.ResetNeeded: no episode is under way.
        """
        if not self._playing:
            raise gymnasium.error.ResetNeeded(
                "no episode is under way: call reset() first, and after each end"
            )
        self.world.step(array_of_actions(self.world.name, action, (NUM_ACTIONS,)).unsqueeze(0))
        state, task = self.world.state, self.world.task
        terminated, truncated = (bool(flag) for flag in task.get_termination(state))
        self._playing = not (terminated or truncated)
        observation, info = self._observe()
        return observation, self.reward_scale * float(task.get_reward(state)), terminated, truncated, info

    def snapshot(self) -> TensorDict:
        """State of the simulation, batch [1], for `reset`'s option; see `tstar_envs.environment`."""
        return self.world.snapshot()

    def render(self) -> np.ndarray | None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Image (height, width, 3) uint8; None where nothing can be drawn, after one warning."""
        frames = self._camera.draw()
        return None if frames is None else frames[0]

    def close(self) -> None:
        self._camera.close()

    def _observe(self) -> tuple[np.ndarray, dict[str, Any]]:
        info = {name: self.world.state[name].item() for name in INFO}
        return self.world.observation().squeeze(0).float().numpy(), info
