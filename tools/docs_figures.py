"""Pictures of the documentation that need no training: docs/figures/player.png and docs/figures/assembly.gif.

    .venv/bin/python tools/docs_figures.py [table_lack]

The first is a screenshot of the page that `make watch` writes (needs Chromium), the second a whole assembly by the
scripted assembler (needs OSMesa or EGL).
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import imageio_ffmpeg
import numpy as np
import torch
from PIL import Image

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "envs"), str(ROOT / "tests")]

from browser import MISSING, Browser, find_chromium  # noqa: E402

from tstar_envs import rendering  # noqa: E402
from tstar_rl import FurnitureEnv  # noqa: E402
from tstar_rl.rollouts.collection import with_starts  # noqa: E402
from tstar_rl.rollouts.watching import record_episode  # noqa: E402

FIGURES = ROOT / "docs" / "figures"
SIZE = (360, 480)
"""Height and width of the film, pixels."""
FRAMES_PER_SECOND = 12
SHOWN = 2
"""Control steps (0.1 s) from one frame to the next."""
LAST = 18
"""How often the last frame is shown, so that the finished piece can be looked at."""


def main() -> None:
    """Writes both."""
    torch.set_num_threads(1)
    task = sys.argv[1] if len(sys.argv) > 1 else "table_lack"
    env = FurnitureEnv(task, 4, nthread=1, seed=0, snapshots=True, velocity_scale=0.4, max_steps=120)
    whole = record_episode(with_starts(env), env.expert(), "scripted assembler", success=True)
    film(env, whole, FIGURES / "assembly.gif")
    screenshot(task, FIGURES / "player.png")


def film(env: FurnitureEnv, episode: dict[str, Any], path: Path) -> None:
    """Writes an episode as GIF with one palette for all frames."""
    renderer = rendering.make_renderer(env.world.drawn_model, *SIZE)
    if renderer is None:
        raise SystemExit(rendering.NOTICE)
    frames = [renderer.draw(qpos) for qpos in episode["positions"][::SHOWN]]
    frames += [renderer.draw(episode["positions"][-1])] * LAST
    renderer.close()
    command = [
        imageio_ffmpeg.get_ffmpeg_exe(),
        "-y",
        "-loglevel",
        "error",
        "-f",
        "rawvideo",
        "-pix_fmt",
        "rgb24",
    ]
    command += ["-s", f"{SIZE[1]}x{SIZE[0]}", "-r", str(FRAMES_PER_SECOND), "-i", "-", "-filter_complex"]
    palette = "split[a][b];[a]palettegen=max_colors=64:stats_mode=full[p]"
    command += [f"{palette};[b][p]paletteuse=dither=none:diff_mode=rectangle", str(path)]
    subprocess.run(command, input=np.stack(frames).tobytes(), check=True)
    print(f"{path.relative_to(ROOT)}: {len(frames)} frames, {path.stat().st_size:,} bytes")


def screenshot(task: str, path: Path) -> None:
    """Writes what `make watch` shows near the end of the episode on the right."""
    if find_chromium() is None:
        raise SystemExit(MISSING)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        page = Path(folder) / "watch.html"
        command = [sys.executable, str(ROOT / "recipes" / "watch.py"), f"task={task}", f"path={page}"]
        environ = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "envs")])}
        subprocess.run(command, check=True, env=environ)
        browser = Browser(Path(folder) / "profile", 1000, 660)
        browser.open(page)
        browser.evaluate("player.seek(player.state().panes[1].steps - 20)")
        browser.screenshot(Path(folder) / "page.png")
        browser.close()
        Image.open(Path(folder) / "page.png").convert("RGB").save(path, optimize=True)
    print(f"{path.relative_to(ROOT)}: {path.stat().st_size:,} bytes")


if __name__ == "__main__":
    main()
