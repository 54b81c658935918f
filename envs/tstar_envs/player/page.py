"""The page itself: scripts, style, scene and episodes put into one file."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

import mujoco

from tstar_envs.player.episode import Episode
from tstar_envs.player.geometry import scene
from tstar_envs.scene import SUBSTEPS, TIMESTEP
from tstar_envs.whole_file import replacing

SCRIPTS = ("matrices.js", "shapes.js", "view.js", "camera.js", "episode.js", "timeline.js", "main.js")
"""In this order: each uses those before it."""


def write_player(
    path: str | Path,
    model: mujoco.MjModel,
    episodes: Sequence[Episode],
    subtasks: Sequence[str] = (),
    phases: Sequence[str] = (),
    title: str = "Episodes",
    step_seconds: float = SUBSTEPS * TIMESTEP,
) -> Path:
    """Writes one HTML file that plays the episodes in a browser, two of them side by side.

    Args:
        path: of the file; its folder is made.
        model: of which the episodes' positions are; see `look.build_drawn_model`.
        episodes: at least one. The first two are shown; with more of them each side can be switched.
        subtasks: names of the subtasks, in order; left out, they are numbered, as many as the episodes show.
        phases: names of the phases of a subtask, in order; left out, they are numbered.
        title: of the page.
        step_seconds: how long a step takes, s.

    Returns:
        The path.

    Raises:
        ValueError: no episode, an episode of another model, fewer names of subtasks than the episodes have, a step of
            no time, or a geom that cannot be drawn.
    """
    if not episodes:
        raise ValueError("a player needs at least one episode, got none")
    least = max(episode.least_subtasks() for episode in episodes)
    if 0 < len(subtasks) < least:
        raise ValueError(
            f"the episodes have {least} subtasks, got {len(subtasks)} names: {', '.join(subtasks)}"
        )
    if not (math.isfinite(step_seconds) and step_seconds > 0):
        raise ValueError(f"step_seconds must be positive, got {step_seconds}")
    content = {
        "title": title,
        "stepSeconds": step_seconds,
        "subtasks": list(subtasks),
        "subtaskCount": len(subtasks) or least,
        "phases": list(phases),
        "scene": scene(model),
        "episodes": [episode.to_plain(model) for episode in episodes],
    }
    path = Path(path)
    with replacing(path) as partial:
        partial.write_text(_page(content), encoding="utf-8")
    return path


def _page(content: dict) -> str:
    files = resources.files("tstar_envs.player") / "web"
    texts = {
        name: (files / name).read_text(encoding="utf-8") for name in ("page.html", "style.css", *SCRIPTS)
    }
    data = json.dumps(content, separators=(",", ":"), allow_nan=False)
    parts = {
        "/*style*/": texts["style.css"],
        "/*scripts*/": "\n".join(texts[name] for name in SCRIPTS),
        "/*content*/": data.replace("<", "\\u003c"),  # a title may hold the end of a script
    }
    page = texts["page.html"]
    for mark, text in parts.items():
        before, after = page.split(mark)
        page = before + text + after
    return page
