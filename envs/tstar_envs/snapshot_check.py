"""Whether a snapshot is one of these simulations: its entries, their shapes and types, and the furniture it is of.

A snapshot carries the furniture's marks without a field for them. Welds that are not made yet hold the relative poses
that the scene was compiled with; those that are made hold two connectors of the recipe together.
"""

from __future__ import annotations

from typing import Any, cast

import mujoco
import torch
from tensordict import TensorDictBase
from torch import Tensor

from tstar_envs import geometry
from tstar_envs.physics.state_row import row_size, row_slice
from tstar_envs.tasks.phase_reward import PHASES
from tstar_envs.tasks.recipe_tables import RecipeTables
from tstar_envs.tasks.task import EpisodeState

ROUNDING = 1e-4
"""By how much compiled poses may differ: simulators of single precision round them."""
NEAR_ONE = 1e-3
"""By how much the length of a quaternion may differ from 1: MuJoCo keeps it at 1 but for rounding."""
APART = 0.1
"""Further apart, m, no weld of the recipe holds its connectors."""


class SnapshotCheck:
    """Refuses what is no snapshot of `num_sims` simulations of the furniture `name`.

    Args:
        name: of the furniture.
        model: its compiled scene.
        tables: its recipe.
        num_sims: simulations N.
        state: their episode state, (N, ...).
    """

    def __init__(
        self, name: str, model: mujoco.MjModel, tables: RecipeTables, num_sims: int, state: EpisodeState
    ):
        self.name, self.tables, self.num_sims = name, tables, num_sims
        device = tables.initial_pose.device
        self._compiled = torch.tensor(model.eq_data, dtype=torch.float64, device=device)
        self._active = row_slice(model, mujoco.mjtState.mjSTATE_EQ_ACTIVE)
        self._qpos = row_slice(model, mujoco.mjtState.mjSTATE_QPOS)
        free = model.jnt_qposadr[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]
        self._quats = torch.tensor(free, device=device).unsqueeze(-1) + torch.arange(3, 7, device=device)
        self._default = torch.tensor(model.qpos0, dtype=torch.float64, device=device)
        self._kinds: dict[Any, tuple[tuple[int, ...], torch.dtype]] = {
            "physics": ((self.num_sims, row_size(model)), torch.float64),
            "welds": ((self.num_sims, *self._compiled.shape), torch.float64),
            **{("task", key): (tuple(value.shape), value.dtype) for key, value in state.items()},
        }

    def layout(self, snapshot: Any) -> None:
        """Checks entries, shapes and types.

        Raises:
            ValueError: it is no TensorDict of this batch, or an entry is missing, or of another shape or type.
        """
        if not isinstance(snapshot, TensorDictBase):
            raise ValueError(
                f"a snapshot is the TensorDict that snapshot() gives, got a {type(snapshot).__name__}"
            )
        if snapshot.batch_size != torch.Size([self.num_sims]):
            raise ValueError(
                f"a snapshot of {self.num_sims} simulations is needed, got {tuple(snapshot.batch_size)}"
            )
        for key, (shape, dtype) in self._kinds.items():
            value, field = snapshot.get(key, None), key if isinstance(key, str) else ".".join(key)
            if value is None:
                raise ValueError(
                    f"a snapshot of {self.name} needs {field!r}, this one has {', '.join(map(str, snapshot.keys()))}; "
                    "take what snapshot() gives"
                )
            if tuple(value.shape) != shape:
                raise ValueError(
                    f"{field!r} of a snapshot of {self.name} has shape {shape}, got {tuple(value.shape)}: "
                    "was it taken of other furniture?"
                )
            if value.dtype != dtype:
                raise ValueError(f"{field!r} of a snapshot of {self.name} is of {dtype}, got {value.dtype}")

    def values(self, snapshot: TensorDictBase, mask: Tensor) -> None:
        """Checks the numbers in the rows of `mask` (N,); the snapshot's layout is right and it is on the device.

        Raises:
            ValueError: a subtask or phase is none of this furniture's, a count is negative, a number is not finite or
                so large that MuJoCo gives up on it, or a part's quaternion is not of length 1.
        """
        steps = self.tables.num_steps
        for name, most in (("subtask", steps), ("phase", len(PHASES) - 1)):
            value = snapshot["task", name]
            if bool((wrong := mask & ((value < 0) | (value > most))).any()):
                row = wrong.nonzero()[0].item()
                end = f" ({steps}: all steps are made)" if name == "subtask" else ""
                raise ValueError(
                    f"'task.{name}' of a snapshot of {self.name} is in 0..{most}{end}, got {value[row].item()} in "
                    f"simulation {row}"
                )
        for name in ("episode_step", "completed"):
            if bool((wrong := mask & ((value := snapshot["task", name]) < 0)).any()):
                row = wrong.nonzero()[0].item()
                raise ValueError(
                    f"'task.{name}' of a snapshot of {self.name} is a count, got {value[row].item()} in "
                    f"simulation {row}"
                )
        for key in self._kinds:
            value, field = cast(Tensor, snapshot[key]), key if isinstance(key, str) else ".".join(key)
            if not value.is_floating_point():
                continue
            wrong = mask & ~(value.reshape(self.num_sims, -1).abs() <= mujoco.mjMAXVAL).all(-1)
            if bool(wrong.any()):
                raise ValueError(
                    f"{field!r} of a snapshot of {self.name} is not finite, or beyond the {mujoco.mjMAXVAL:.0e} at "
                    f"which MuJoCo gives up, in simulation {wrong.nonzero()[0].item()}"
                )

        lengths = snapshot["physics"][:, self._qpos][:, self._quats].norm(dim=-1)  # (N, parts)
        wrong = mask & ((lengths - 1).abs() > NEAR_ONE).any(-1)
        if bool(wrong.any()):
            row = wrong.nonzero()[0].item()
            length = lengths[row][(lengths[row] - 1).abs().argmax()].item()
            raise ValueError(
                f"a part's quaternion in the snapshot of {self.name} in simulation {row} has length {length:.3g}, not 1"
            )

    def furniture(self, snapshot: TensorDictBase, mask: Tensor) -> None:
        """Checks the welds in the rows of `mask` (N,); the snapshot's layout is right and it is on the device.

        Raises:
            ValueError: a row was taken of other furniture, or other welds hold than those of the steps before its own.
        """
        active, welds = snapshot["physics"][:, self._active] > 0, snapshot["welds"]
        steps, subtask = torch.arange(active.shape[1], device=active.device), snapshot["task", "subtask"]
        waits = snapshot["task", "failed"]  # a simulation that was given up has no welds until its reset
        amiss = mask & ~waits & (active != (steps < subtask.unsqueeze(-1))).any(-1)
        if bool(amiss.any()):
            row = amiss.nonzero()[0].item()
            held = active[row].nonzero().flatten().tolist()
            raise ValueError(
                f"the snapshot in simulation {row} is of no state of {self.name}: at subtask {subtask[row].item()} the "
                f"welds of the steps before it hold, here those of steps {held}"
            )
        own = (welds - self._compiled).abs().amax(-1) <= ROUNDING
        if bool((active & mask.unsqueeze(-1)).any()):
            own = torch.where(active, self._joins(welds), own)
        foreign = mask & ~own.all(-1)
        if bool(foreign.any()):
            raise ValueError(
                f"the snapshot in simulation {foreign.nonzero()[0].item()} was not taken of {self.name} as it is now: "
                "its welds are those of other furniture, or of an earlier file of this one"
            )

    def begun(self, snapshot: TensorDictBase) -> Tensor:
        """(N,) bool: whether an episode was begun; one that was given up counts.

        Before the first reset all joints are where the compiled scene has them.
        """
        moved = (snapshot["physics"][:, self._qpos] - self._default).abs().amax(-1) > ROUNDING
        return moved | snapshot["task", "failed"]

    def has_episode(self, snapshot: TensorDictBase, mask: Tensor) -> None:
        """Checks that the rows of `mask` (N,) are of episodes.

        Raises:
            ValueError: one is of a simulation that was given up, or of one that had not begun.
        """
        for none, why in (
            (snapshot["task", "failed"], "was given up"),
            (~self.begun(snapshot), "had not begun: call reset() before snapshot()"),
        ):
            if bool((none & mask).any()):
                row = (none & mask).nonzero()[0].item()
                raise ValueError(
                    f"no episode of {self.name} can start from the snapshot in simulation {row}: that one {why}"
                )

    def begins(self, snapshot: TensorDictBase, mask: Tensor, subtask: int | None) -> None:
        """Checks that episodes of `subtask` (None: the whole task) can begin in the rows of `mask` (N,).

        Raises:
            ValueError: one is at another subtask, or has nothing left to assemble.
        """
        found = snapshot["task", "subtask"]
        wrong = mask & (found >= self.tables.num_steps if subtask is None else found != subtask)
        if bool(wrong.any()):
            raise ValueError(
                f"episodes of {_named(subtask)} of {self.name} cannot start from snapshots of subtask "
                f"{found[wrong][0].item()}; take states in which a subtask of theirs begins"
            )

    def goes_on(self, snapshot: TensorDictBase, mask: Tensor, subtask: int | None) -> None:
        """Checks that episodes of `subtask` (None: the whole task) come to the states in the rows of `mask` (N,).

        Episodes of one subtask are past it by what they completed, if they are stepped on after their success. One of
        subtask 0 that was looks like one of the whole task, so such a state is taken there.

        Raises:
            ValueError: one is at another subtask. What was given up, or had not begun, waits for its reset anywhere.
        """
        if subtask is None:
            return
        task, found = snapshot["task"], snapshot["task", "subtask"]
        there = (found == subtask) | (found == subtask + task["completed"])
        wrong = mask & self.begun(snapshot) & ~task["failed"] & ~there
        if bool(wrong.any()):
            raise ValueError(
                f"episodes of {_named(subtask)} of {self.name} never come to where the snapshot in simulation "
                f"{wrong.nonzero()[0].item()} is, at subtask {found[wrong][0].item()}; restore it in an environment of "
                "that subtask, or of the whole task"
            )

    def _joins(self, welds: Tensor) -> Tensor:
        """(N, K): whether a weld brings the connectors of its step together."""
        moving, target = self.tables.moving_connector[:, :3], self.tables.target_connector[:, :3]
        point = welds[..., 3:6] + geometry.quat_rotate(welds[..., 6:10], moving.expand_as(welds[..., 3:6]))
        return (point - target).norm(dim=-1) < APART


def _named(subtask: int | None) -> str:
    return "the whole task" if subtask is None else f"subtask {subtask}"
