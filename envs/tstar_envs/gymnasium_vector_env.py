"""N simulations of an assembly task as a `gymnasium.vector.VectorEnv`: `gymnasium.make_vec` on the batched simulator.

envs = gymnasium.make_vec("tstar/TableLack-v0", num_envs=64, subtask=0)
observations, infos = envs.reset(seed=0)
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from tensordict import TensorDict
from torch import Tensor

from tstar_envs.checks import finite_number
from tstar_envs.environment import BatchedEnvironment
from tstar_envs.gymnasium_shared import INFO, METADATA, Camera, begin, read_options, spaces, world_seed
from tstar_envs.settings import TaskSettings
from tstar_envs.tasks.actions import NUM_ACTIONS, array_of_actions


class GymnasiumVectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """An assembly task with numpy arrays in and out, one row a simulation; see `gymnasium_env.GymnasiumEnv`.

    What happens after the end of an episode is Gymnasium's, by `autoreset_mode`:

    - `NextStep`: the next step ignores that row's action, starts its next episode and gives reward 0.
    - `SameStep`: the row's observation is already the next episode's; `infos["final_obs"]` and
      `infos["final_info"]` hold what the episode ended with.
    - `Disabled`: the caller resets it, `reset(options={"reset_mask": ended})`; a step before that raises.

    Rewards are float64 (N,), flags bool (N,); `infos` has arrays (N,) under the names of the single environment's
    info, and under `_<name>` which rows are meant. One generator draws every row's start noise, so a seed gives the
    same rows again for the same number of simulations. `reset` takes the options `snapshot`, of batch [N], and
    `reset_mask`, (N,) bool: rows outside it go on with their episodes.

    Args:
        task: furniture, e.g. `table_lack`; `gymnasium.make_vec` fills it in.
        num_envs: simulations N.
        subtask: step of the recipe, 0-based; None for the whole task.
        nthread: threads that step the simulations (0: all cores); results are the same bits at any number.
        reward_scale: factor of the reward; the paper's policies see 0.05.
        autoreset_mode: a `gymnasium.vector.AutoresetMode`, or its value.
        render_mode: `rgb_array`, or None.
        width: of an image, pixels.
        height: of an image, pixels.
        **settings: fields of `tstar_envs.settings.TaskSettings`.

    Raises:
        ValueError: unknown furniture, subtask, autoreset or render mode; a setting or number that cannot be.
        TypeError: a keyword that is no setting.
    """

    metadata: dict[str, Any] = {**METADATA, "autoreset_mode": AutoresetMode.NEXT_STEP}  # noqa: RUF012

    def __init__(
        self, task: str, num_envs: int = 1, subtask: int | None = None, nthread: int = 0, reward_scale: float = 1.0,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP, render_mode: str | None = None,
        width: int = 640, height: int = 480, **settings: Any,
    ):  # fmt: skip
        self.autoreset_mode = _autoreset(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        chosen = TaskSettings.from_keywords(type(self).__name__, settings)
        self.world = BatchedEnvironment(task, num_envs, subtask, nthread, settings=chosen)
        self.num_envs, self.render_mode = num_envs, render_mode
        self.reward_scale = finite_number("reward_scale", reward_scale)
        self.single_observation_space, self.single_action_space = spaces(self.world)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._camera = Camera(self.world, render_mode, width, height)
        self._ended, self._begun = (torch.full((num_envs,), flag) for flag in (True, False))
        self._seeded = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Starts episodes.

        Raises:
            ValueError: an unknown option, a mask of another kind, or a snapshot of another batch or subtask.
        """
        options = read_options(self.world, options, ("snapshot", "reset_mask"))
        mask = self._read_mask(options.get("reset_mask"))
        drawn = world_seed(self, seed, first=not self._seeded)
        if options.get("snapshot") is None:  # one that is refused leaves the episodes that are under way
            self._ended, self._begun = self._ended | mask, self._begun & ~mask  # while no episode can begin
        begin(self.world, drawn, options.get("snapshot"), mask)
        super().reset(seed=seed)
        self._seeded = True
        self._ended, self._begun = self._ended & ~mask, self._begun | mask
        return self._observe(), self._infos(mask)

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One control step, 0.1 s, of every simulation.

        Raises:
            ValueError: the actions have another shape, or one is NaN.
            gymnasium.error.ResetNeeded: an episode has ended, or none has begun, and this step is not to reset it.
        """
        self._check_begun()
        over, values = self._ended, array_of_actions(self.world.name, actions, (self.num_envs, NUM_ACTIONS))
        resets = bool(over.any())
        self.world.step(values, ~over if resets else None)
        state, task = self.world.state, self.world.task
        if resets:
            terminated, truncated = task.get_termination(state)
            self._ended = (
                over | terminated | truncated
            )  # should no episode begin, they are known to have ended
            self.world.reset(over)
        terminated, truncated = task.get_termination(state)
        rewards = self.reward_scale * task.get_reward(state).numpy()
        self._ended = terminated | truncated
        final = self._next_episodes() if self.autoreset_mode is AutoresetMode.SAME_STEP else {}
        infos = {**self._infos(torch.ones_like(terminated)), **final}
        return self._observe(), rewards, terminated.numpy(), truncated.numpy(), infos

    def snapshot(self) -> TensorDict:
        """State of every simulation, batch [N], for `reset`'s option; see `tstar_envs.environment`."""
        return self.world.snapshot()

    def render(self) -> tuple[np.ndarray, ...] | None:
        """N images (height, width, 3) uint8; None where nothing can be drawn, after one warning."""
        return self._camera.draw()

    def close(self, **kwargs: Any) -> None:
        """Gives back what pictures need; a picture after it makes that anew, so it may be called again.

        Keywords of Gymnasium's other vectors, which have processes to end, say nothing here.
        """
        self._camera.close()
        super().close()

    def _next_episodes(self) -> dict[str, Any]:
        """Starts the next episode where one has ended; returns what it ended with, as Gymnasium lays it out."""
        ended = self._ended
        if not bool(ended.any()):
            return {}
        mask, final = ended.numpy(), np.full(self.num_envs, None, dtype=object)
        for row, observation in zip(mask.nonzero()[0], self._observe()[mask], strict=True):
            final[row] = observation
        infos = {"final_obs": final, "final_info": self._infos(ended)}
        self.world.reset(ended)
        self._ended = torch.zeros_like(ended)
        return infos | {f"_{name}": mask.copy() for name in infos}

    def _observe(self) -> np.ndarray:
        return self.world.observation().float().numpy()

    def _infos(self, mask: Tensor) -> dict[str, Any]:
        values = {name: (self.world.state[name] * mask).numpy() for name in INFO}
        return values | {f"_{name}": mask.numpy().copy() for name in INFO}

    def _read_mask(self, mask: Any) -> Tensor:
        if mask is None:
            return torch.ones(self.num_envs, dtype=torch.bool)
        mask = np.asarray(mask)
        if mask.shape != (self.num_envs,) or mask.dtype != np.bool_:
            raise ValueError(
                f"reset option 'reset_mask' has shape ({self.num_envs},) and type bool; "
                f"got {mask.dtype} of shape {mask.shape}"
            )
        if not mask.any():
            raise ValueError("reset option 'reset_mask' resets no environment: got False everywhere")
        return torch.from_numpy(mask.copy())

    def _check_begun(self) -> None:
        waiting = ~self._begun if self.autoreset_mode is AutoresetMode.NEXT_STEP else self._ended
        if bool(waiting.any()):
            rows = waiting.nonzero().flatten().tolist()[:8]
            raise gymnasium.error.ResetNeeded(
                f"no episode is under way in simulations {rows}: call reset() first"
            )


def _autoreset(mode: AutoresetMode | str) -> AutoresetMode:
    try:
        return AutoresetMode(mode)
    except ValueError:
        valid = ", ".join(repr(one.value) for one in AutoresetMode)
        raise ValueError(f"autoreset_mode must be one of {valid}; got {mode!r}") from None
