"""N simulations of an assembly task as a `VecEnv` of Stable-Baselines3, on the batched simulator.

from stable_baselines3 import PPO
env = StableBaselinesEnv("table_lack", 64, subtask=0, reward_scale=0.05)
PPO("MlpPolicy", env, device="cpu").learn(100_000)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from tstar_envs.gymnasium_shared import INFO, METADATA
from tstar_envs.gymnasium_vector_env import GymnasiumVectorEnv
from tstar_envs.rendering import backend
from tstar_envs.settings import TaskSettings

try:
    from stable_baselines3.common.vec_env import VecEnv
except ImportError as missing:
    raise ImportError("this environment needs Stable-Baselines3: pip install 'tstar_rl[sb3]'") from missing


class StableBaselinesEnv(VecEnv):
    """An assembly task as Stable-Baselines3 takes it: an ended row's observation is the next episode's.

    Infos are one dict a row: `success`, `subtask`, `phase` and `completed` of the state that the step led to. Where an
    episode ends, there are `is_success`, from which SB3 logs a success rate, `terminal_observation` (O,) and
    `TimeLimit.truncated` too. `stable_baselines3.common.vec_env.VecMonitor` adds returns and lengths.

    One generator draws every row's start noise, so `seed(s)` gives the same rows again for the same number of
    simulations.

    Args:
        task: furniture, e.g. `table_lack`.
        num_envs: simulations N.
        subtask: step of the recipe, 0-based; None for the whole task.
        nthread: threads that step the simulations (0: all cores).
        reward_scale: factor of the reward; the paper's policies see 0.05.
        render_mode: `rgb_array`, or None.
        width: of an image, pixels.
        height: of an image, pixels.
        **settings: fields of `tstar_envs.settings.TaskSettings`.

    Raises:
        ValueError: unknown furniture, subtask or render mode; a setting or number that cannot be.
        TypeError: a keyword that is no setting.
    """

    def __init__(
        self, task: str, num_envs: int = 1, subtask: int | None = None, nthread: int = 0, reward_scale: float = 1.0,
        render_mode: str | None = None, width: int = 640, height: int = 480, **settings: Any,
    ):  # fmt: skip
        TaskSettings.from_keywords(type(self).__name__, settings)
        self.envs = GymnasiumVectorEnv(
            task, num_envs, subtask, nthread, reward_scale, AutoresetMode.SAME_STEP, render_mode, width, height,
            **settings,
        )  # fmt: skip
        self._actions: np.ndarray | None = None
        spaces = self.envs.single_observation_space, self.envs.single_action_space
        super().__init__(num_envs, *spaces)  # type: ignore[arg-type]
        self.metadata |= {"render_fps": METADATA["render_fps"]}  # recorders read it

    def reset(self) -> np.ndarray:
        """Starts an episode in every row; float32 (N, O)."""
        observations, infos = self.envs.reset(seed=self._seeds[0], options=self._options[0])
        self.reset_infos = [_row(infos, row) for row in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: np.ndarray) -> None:
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """One control step, 0.1 s: observations (N, O), rewards float32 (N,), ends (N,) bool, and infos."""
        observations, rewards, terminated, truncated, values = self.envs.step(self._actions)
        ended = terminated | truncated
        infos = [_row(values, row) for row in range(self.num_envs)]
        for row in ended.nonzero()[0]:
            final = _row(values["final_info"], row)
            self.reset_infos[row] = infos[row]
            infos[row] = final | {
                "is_success": final["success"],
                "terminal_observation": values["final_obs"][row],
                "TimeLimit.truncated": bool(truncated[row] and not terminated[row]),
            }
        return observations, rewards.astype(np.float32), ended, infos

    def set_options(self, options: Sequence[dict[str, Any]] | dict[str, Any] | None = None) -> None:
        """Options of the next `reset`, which are of the whole vector, e.g. `snapshot` of batch [N].

        Raises:
            ValueError: they are a list, one of each row.
        """
        if options is not None and not isinstance(options, dict):
            raise ValueError(
                f"options are one dict for all simulations, e.g. a snapshot of batch [{self.num_envs}]; "
                f"got a {type(options).__name__}"
            )
        self._options = [options or {}]

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the vector, once for every row: all rows have one object."""
        return [getattr(self.envs, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Not for rows: what is written is of all of them.

        Raises:
            ValueError: only some rows are meant.
        """
        if indices is not None:
            raise ValueError(
                f"all simulations are one object: {attr_name!r} cannot be set for rows {indices}"
            )
        setattr(self.envs, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Not for rows: call the method of `envs`, which is all of them.

        Raises:
            NotImplementedError: always.
        """
        raise NotImplementedError(f"all simulations are one object: call envs.{method_name}() of this one")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Images (height, width, 3) uint8, which `render` lays side by side."""
        return self.envs.render() or [None] * self.num_envs

    def render(self, mode: str | None = None) -> np.ndarray | None:
        """All images in one; None where nothing can be drawn, after one warning."""
        return super().render(mode) if backend() else None

    def close(self) -> None:
        self.envs.close()


def _row(values: dict[str, Any], row: int) -> dict[str, Any]:
    return {name: values[name][row].item() for name in INFO}
