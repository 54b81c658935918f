"""dm_control's `Physics` over one simulation of an assembly task."""

from __future__ import annotations

import importlib
import os
import sys
from typing import Any

import torch

from tstar_envs import rendering
from tstar_envs.physics.single import SinglePhysics


def _no_screen() -> bool:
    """Whether there is no screen to draw on."""
    return sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


_OFF = _no_screen() and not os.environ.get("MUJOCO_GL")
if _OFF:
    os.environ["MUJOCO_GL"] = "off"  # while dm_control is imported: it would try a window first, and complain
try:
    from dm_control import _render
    from dm_control.mujoco import Physics
finally:
    if _OFF:
        del os.environ["MUJOCO_GL"]


class AssemblyPhysics(Physics):
    """dm_control's physics, stepped as every simulator here; `data` is the simulation.

    What MuJoCo gives up on raises nothing: it is in `failed` and ends the episode, as in every front. Without a screen
    `render` takes EGL or OSMesa, whichever works, unless `MUJOCO_GL` decides it.
    """

    view: SinglePhysics
    """The simulation as tensors, for the task."""
    failed: torch.Tensor
    """(1,) bool: whether MuJoCo gave up on the simulation in the last control step, or in a step since."""

    def step(self, nstep: int = 1) -> None:
        """Takes `nstep` physics steps under the controls in `view.ctrl`."""
        failed = self.view.step(nstep)
        self.failed, self._told = failed if self._told else self.failed | failed, False

    def tell_failed(self) -> torch.Tensor:
        """`failed`, which the next step begins anew: until it is told, a failure stays."""
        self._told = True
        return self.failed

    def set_control(self, control: Any) -> None:
        """Sets the controls (9,): seven joint velocities, rad/s, and two finger positions, m."""
        super().set_control(control)
        self.view.catch_up()

    def reset(self, keyframe_id: int | None = None) -> None:
        """Puts the simulation back to the model's default state, all welds undone.

        Raises:
            ValueError: a keyframe is asked for; the scene has none.
        """
        if keyframe_id is not None:
            raise ValueError(f"the scene has no keyframes: keyframe_id must be None, got {keyframe_id!r}")
        self.failed, self._told = torch.zeros(1, dtype=torch.bool), True
        self.view.clear(torch.ones(1, dtype=torch.bool))
        self.view.forward()

    def after_reset(self) -> None:
        """Positions, velocities and their sensors are current then, whatever was written since `reset`."""
        self.view.refresh()

    def copy(self, share_model: bool = False) -> AssemblyPhysics:
        """A simulation in the same state; its `reset` undoes all welds, as here.

        It has a model of its own, whatever `share_model` says: the poses of welds lie there.
        """
        copied = super().copy()
        copied.view.compiled_welds.copy_(self.view.compiled_welds)
        return copied

    def __getstate__(self) -> tuple[Any, torch.Tensor]:
        return super().__getstate__(), self.view.compiled_welds

    def __setstate__(self, state: tuple[Any, torch.Tensor]) -> None:
        data, welds = state
        super().__setstate__(data)
        self.view.compiled_welds.copy_(welds)

    def _reload_from_data(self, data: Any) -> None:
        self.view = SinglePhysics(data.model.ptr, data.ptr)
        self.failed, self._told = torch.zeros(1, dtype=torch.bool), True
        super()._reload_from_data(data)
        self.view.forward()

    def _make_rendering_contexts(self) -> None:
        undecided = os.environ.get("MUJOCO_GL", "") in ("", *rendering.BACKENDS)
        blind = _no_screen() and undecided and _render.BACKEND not in rendering.BACKENDS
        if blind and (graphics := rendering.backend()) is not None:
            rendering.choose(graphics)
            importlib.reload(_render)
        super()._make_rendering_contexts()
