"""What a world did, as a film and as a page that plays it in a browser."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from torch import Tensor

from tstar_envs import player, rendering
from tstar_envs.environment import BatchedEnvironment
from tstar_envs.tasks.phase_reward import PHASES

__all__ = ["write_mp4", "write_player"]


def write_mp4(world: BatchedEnvironment, path: str | Path, positions: Tensor) -> bool:
    """Films joint positions (T, nq); False, after one warning, where nothing can draw."""
    renderer = rendering.make_renderer(world.drawn_model, smooth=False)
    if renderer is None:
        return False
    try:
        rendering.write_mp4(path, (renderer.draw(row) for row in positions.cpu()))
    finally:
        renderer.close()
    return True


def write_player(
    world: BatchedEnvironment,
    path: str | Path,
    episodes: Sequence[Mapping[str, Any]],
    title: str | None = None,
) -> Path:
    """Writes one HTML file that plays episodes in a browser; returns its path.

    Args:
        world: whose model is drawn.
        path: of the file.
        episodes: each the arguments of `tstar_envs.player.Episode` by name; see `watching.EpisodeLog.episode`.
        title: of the page, by default the task's name.
    """
    subtasks = [f"{step.moving_part} to {step.target_part}" for step in world.furniture.steps]
    recorded = [player.Episode(**episode) for episode in episodes]
    return player.write_player(path, world.drawn_model, recorded, subtasks, PHASES, title or world.name)
