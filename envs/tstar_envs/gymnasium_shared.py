"""What the two Gymnasium environments share: spaces, options, actions, pictures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import mujoco
import numpy as np
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import VectorEnv
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from tstar_envs import rendering
from tstar_envs.checks import whole_number
from tstar_envs.environment import BatchedEnvironment
from tstar_envs.scene import LARGEST_IMAGE
from tstar_envs.tasks.actions import NUM_ACTIONS
from tstar_envs.tasks.phase_reward import PHASES

METADATA: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 10}
INFO = ("success", "subtask", "phase", "completed")
"""What `info` carries: entries of the task's state."""


class Camera:
    """Pictures of every simulation of a world, in Gymnasium's render mode `mode`."""

    def __init__(self, world: BatchedEnvironment, mode: str | None, width: int, height: int):
        valid = (None, *METADATA["render_modes"])
        if mode not in valid:
            raise ValueError(f"render_mode must be one of {', '.join(map(repr, valid))}; got {mode!r}")
        self.world, self.mode = world, mode
        widest, highest = LARGEST_IMAGE
        self.width, self.height = (
            whole_number("width", width, 1, widest),
            whole_number("height", height, 1, highest),
        )
        self._renderer: rendering.Renderer | None = None

    def draw(self) -> tuple[np.ndarray, ...] | None:
        """N images (height, width, 3) uint8, or None: without a render mode, or where nothing can be drawn."""
        if self.mode is None:
            gymnasium.logger.warn(
                "render() draws nothing here: make the environment with render_mode='rgb_array'"
            )
            return None
        if self._renderer is None:
            self._renderer = rendering.make_renderer(self.world.drawn_model, self.height, self.width)
        if self._renderer is None:
            return None
        return tuple(self._renderer.draw(row) for row in self.world.physics.qpos)

    def close(self) -> None:
        """Gives back the graphics context; a later `draw` makes another."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None


def spaces(world: BatchedEnvironment) -> tuple[Box, Box]:
    """Observation space (O,) and action space (9,) of one simulation, float32.

    Quaternions and the phase are bounded by nature. The other bounds are where MuJoCo gives up on a simulation.
    """
    far, unit = mujoco.mjMAXVAL, 1.0
    robot = [far] * 19 + [unit] * 4 + [far] * 6
    parts = ([far] * 3 + [unit] * 4) * len(world.furniture.parts)
    high = np.array([*robot, *parts, *[1.0] * len(PHASES)], dtype=np.float32)
    low = -high
    low[-len(PHASES) :] = 0.0
    return Box(low, high, dtype=np.float32), Box(-1.0, 1.0, (NUM_ACTIONS,), dtype=np.float32)


def read_options(
    world: BatchedEnvironment, options: Mapping[str, Any] | None, valid: tuple[str, ...]
) -> dict[str, Any]:
    """Checks the options of a reset.

    Raises:
        ValueError: they are no mapping, one is not of `valid`, or `snapshot` is no snapshot of as many simulations.
    """
    if options is not None and not isinstance(options, Mapping):
        raise ValueError(f"reset options are a mapping of {', '.join(valid)}; got {options!r}")
    options = dict(options or {})
    for name in options:
        if name not in valid:
            raise ValueError(f"unknown reset option {name!r}; valid options: {', '.join(valid)}")
    snapshot = options.get("snapshot")
    if snapshot is not None:
        batch = tuple(snapshot.batch_size) if isinstance(snapshot, TensorDictBase) else None
        if batch != (world.num_sims,):
            got = type(snapshot).__name__ if batch is None else f"batch {batch}"
            raise ValueError(
                "reset option 'snapshot' is what an environment's snapshot() returns, of batch "
                f"({world.num_sims},) here; got {got}"
            )
    return options


def world_seed(env: gymnasium.Env | VectorEnv, seed: int | None, first: bool) -> int | None:
    """The seed of the world at a reset of `env` with `seed`; None: the world goes on drawing.

    Gymnasium's seeds may be larger than the world's, which has their last 64 bits. The `first` reset, if it is without
    a seed, takes the environment's own `np_random_seed`, or a draw of the generator that it was given.

    Raises:
        gymnasium.error.Error: it is no seed. Nothing has changed then.
    """
    if seed is not None:
        seeding.np_random(seed)
        return int(seed) % 2**64
    if not first:
        return None
    own = env.np_random_seed
    return int(env.np_random.integers(2**63)) if own is None or own < 0 else int(own) % 2**64


def begin(
    world: BatchedEnvironment, seed: int | None, snapshot: TensorDict | None, mask: Tensor | None = None
) -> None:
    """Starts episodes in the simulations of `mask`, by default all: from `snapshot`, or else as the task does.

    A snapshot that is refused changes nothing, not even the generator.
    """
    if snapshot is not None:
        world.reset_to(snapshot, mask)
    if seed is not None:
        world.seed(seed)
    if snapshot is None:
        world.reset(mask)
