"""Pictures without a screen: any simulation state to an image, images to PNG or mp4.

EGL or OSMesa is taken, whichever works here; `MUJOCO_GL=egl` or `MUJOCO_GL=osmesa` decides it instead, and with
`MUJOCO_GL=off` nothing is drawn. Other values, which ask for a window, are not heeded. Where nothing can be drawn, one
sentence says so once, and everything that would have been drawn is None.

    renderer = make_renderer(model)
    if renderer is not None:
        write_mp4("out.mp4", [renderer.draw(qpos) for qpos in episode])
"""

from __future__ import annotations

import atexit
import errno
import functools
import importlib
import itertools
import os
import shutil
import subprocess
import sys
import warnings
import weakref
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from tstar_envs.checks import finite_number
from tstar_envs.whole_file import replacing

BACKENDS = ("egl", "osmesa")
OFF = ("off", "disable", "disabled", "false", "0")
"""Values of MUJOCO_GL that MuJoCo reads as no graphics."""
CAMERA = "workplace"
VARIABLES = ("MUJOCO_GL", "PYOPENGL_PLATFORM")
"""Of the environment, that say which of them draws; the first that is set counts."""
A_FILM = 2_000_000
"""Bytes; a film has half of it at most."""
NOTICE = (
    "Nothing is drawn: neither EGL nor OSMesa works here (on Debian: apt-get install libosmesa6); "
    "everything else goes on without pictures."
)
ASKED = "Nothing is drawn: {} asks for {}, which does not work here, and so the other one is not tried."
UNWANTED = "Nothing is drawn: {}={} says so."
_PROBE = """
import importlib, sys, mujoco
context = importlib.import_module("mujoco." + sys.argv[1]).GLContext(16, 16)
context.make_current()
mujoco.MjrContext(mujoco.MjModel.from_xml_string("<mujoco/>"), mujoco.mjtFontScale.mjFONTSCALE_100.value).free()
context.free()
"""


@functools.cache
def backend() -> str | None:
    """Returns the first of EGL and OSMesa that works, tried in its own process; None, and a warning, if none does."""
    variable = next((name for name in VARIABLES if os.environ.get(name)), VARIABLES[0])
    wanted = os.environ.get(variable, "").lower()
    if wanted in OFF:
        warnings.warn(UNWANTED.format(variable, wanted), stacklevel=2)
        return None
    decided = wanted in BACKENDS
    for name in (wanted,) if decided else BACKENDS:
        environment = {**os.environ, "MUJOCO_GL": name, "PYOPENGL_PLATFORM": name}
        probe = subprocess.run([sys.executable, "-c", _PROBE, name], env=environment, capture_output=True)
        if probe.returncode == 0:
            return name
    warnings.warn(ASKED.format(variable, wanted) if decided else NOTICE, stacklevel=2)
    return None


class Renderer:
    """Draws states of one model from a fixed camera; see `make_renderer`.

    Args:
        model: compiled scene.
        graphics: `egl` or `osmesa`.
        height: pixels.
        width: pixels.
        camera: name of a camera of the model.
        smooth: False: edges are not smoothed and shadows are coarser. Without a GPU a frame takes half the time.
    """

    def __init__(
        self, model: mujoco.MjModel, graphics: str, height: int, width: int, camera: str, smooth: bool = True
    ) -> None:
        if mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, camera) < 0:
            valid = ", ".join(repr(model.camera(i).name) for i in range(model.ncam)) or "none"
            raise ValueError(f"no camera is called {camera!r}; valid: {valid}")
        self.model, self.camera, self._data = model, camera, mujoco.MjData(model)
        choose(graphics)
        with nullcontext() if smooth else _rough(model):
            self._renderer = mujoco.Renderer(model, height, width)
        # MuJoCo centres the floor on the camera of the frame before: without one the first image would differ.
        self._renderer.update_scene(self._data, camera)
        self._close = weakref.finalize(self, _close, self._renderer)
        self._close.atexit = False  # that would be after MuJoCo has ended the display
        atexit.register(self._close)

    def draw(self, qpos: np.ndarray) -> np.ndarray:
        """Image (height, width, 3) uint8 of the joint positions `qpos` (nq,): a row of a batch, array or CPU tensor."""
        positions = np.asarray(qpos, dtype=np.float64)
        if positions.shape != (self.model.nq,):
            raise ValueError(
                f"joint positions of one state have shape ({self.model.nq},), got {positions.shape}"
            )
        self._data.qpos[:] = positions
        mujoco.mj_kinematics(self.model, self._data)
        mujoco.mj_camlight(self.model, self._data)
        self._renderer.update_scene(self._data, self.camera)
        return self._renderer.render()

    def close(self) -> None:
        """Gives back the graphics context, as the end of Python does at the latest; other renderers go on."""
        atexit.unregister(self._close)
        self._close()


def _close(renderer: mujoco.Renderer) -> None:
    try:
        renderer.render()  # makes this context current: MuJoCo deletes the objects of the one that is
    except Exception:
        # At the end of Python, where dm_control has ended the display that they share: all is gone.
        renderer._gl_context._context = None  # or MuJoCo would give it back once more, with a traceback
        renderer._mjr_context = None
        return
    renderer.close()


@contextmanager
def _rough(model: mujoco.MjModel) -> Iterator[None]:
    """A model that asks for less while a graphics context is made, which is when MuJoCo reads it."""
    quality = model.vis.quality
    kept = quality.offsamples, quality.shadowsize
    quality.offsamples, quality.shadowsize = 0, min(quality.shadowsize, 1024)
    try:
        yield
    finally:
        quality.offsamples, quality.shadowsize = kept


def make_renderer(
    model: mujoco.MjModel, height: int = 480, width: int = 640, camera: str = CAMERA, smooth: bool = True
) -> Renderer | None:
    """Returns a renderer of `model`, or None where nothing can be drawn; see `Renderer`.

    Raises:
        ValueError: the model has no camera of that name.
    """
    graphics = backend()
    return None if graphics is None else Renderer(model, graphics, height, width, camera, smooth)


def choose(graphics: str) -> None:
    """Makes MuJoCo take `graphics`: it reads MUJOCO_GL when it is imported, which may have been long ago."""
    os.environ["MUJOCO_GL"] = os.environ["PYOPENGL_PLATFORM"] = graphics
    context = importlib.import_module("mujoco.rendering.classic.gl_context")
    loaded = context.GLContext.__module__  # a user may have set the variable since
    if not loaded.startswith(f"mujoco.{graphics}"):
        importlib.reload(context)


def _took(act: Callable[..., Any], *arguments: Any) -> bool:
    """Whether the pipe to ffmpeg held; why it broke, ffmpeg alone knows."""
    try:
        act(*arguments)
    except OSError:
        return False
    return True


def write_png(path: str | Path, image: np.ndarray) -> None:
    """Writes an image (height, width, 3) uint8."""
    from matplotlib import image as matplotlib_image

    with replacing(Path(path)) as partial:
        matplotlib_image.imsave(partial, np.ascontiguousarray(image), format="png")


def write_mp4(path: str | Path, frames: Iterable[np.ndarray], frames_per_second: float = 20.0) -> None:
    """Writes images (height, width, 3) uint8 as H.264; at 20 a second, 10 Hz control is shown at twice its speed.

    An earlier film at that path stays until this one is whole.

    Raises:
        ValueError: the path does not end in .mp4, there are no frames, or not some of them a second.
        OSError: if the film cannot be written, as on a full disk.
    """
    import imageio.v2 as imageio

    path, frames = Path(path), iter(frames)
    if path.suffix.lower() != ".mp4":
        raise ValueError(f"a film is a file that ends in .mp4, got {str(path)!r}")
    if not finite_number("frames_per_second", frames_per_second) > 0:
        raise ValueError(f"frames_per_second must be positive, got {frames_per_second}")
    first = list(itertools.islice(frames, 1))
    if not first:
        raise ValueError(f"a film needs at least one frame, got none for {str(path)!r}")
    with replacing(path) as partial:
        film = imageio.get_writer(partial, format="FFMPEG", fps=frames_per_second, macro_block_size=8)
        try:
            for frame in itertools.chain(first, frames):
                if not _took(film.append_data, frame):  # pyright: ignore[reportAttributeAccessIssue]
                    break
        except BaseException:  # of what draws the frames
            _took(film.close)
            raise
        whole = (
            _took(film.close) and partial.is_file() and b"moov" in partial.read_bytes()
        )  # ffmpeg writes that last
        if not whole:
            code = errno.ENOSPC if shutil.disk_usage(path.parent).free < A_FILM else errno.EIO
            raise OSError(code, os.strerror(code), str(path))
