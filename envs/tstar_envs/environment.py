"""The batched environment under every front: N simulations, one task, their random numbers and snapshots."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import torch
from tensordict import TensorDict
from torch import Tensor

from tstar_envs.checks import whole_number
from tstar_envs.experts.assembler import Assembler
from tstar_envs.furniture import Furniture, library
from tstar_envs.physics.simulators import make_physics
from tstar_envs.scene import SUBSTEPS, build_model
from tstar_envs.settings import TaskSettings
from tstar_envs.snapshot_check import SnapshotCheck
from tstar_envs.state_edit import StateEditor
from tstar_envs.tasks.actions import NUM_ACTIONS
from tstar_envs.tasks.assembly import Assembly, assign
from tstar_envs.tasks.phase_reward import PHASES

NUM_OBSERVATIONS_ROBOT = 29


class BatchedEnvironment:
    """N simulations of one assembly task.

    `reset(mask)` and `step(actions)` leave what happened in `state` (see `tasks.assembly`); `observation()` reads it.
    A simulation that MuJoCo gives up on ends its own episode as a failure, is counted in `failures` and waits for a
    reset; the others do not notice. One that fails while an episode's start settles is counted too, and drawn again.

    Args:
        name: furniture, e.g. `table_lack`, or a piece that is not in the library.
        num_sims: how many simulations.
        subtask: step of the recipe, 0-based, or None for the whole task.
        nthread: threads that step the simulations, 0 for all cores. Results do not depend on it.
        seed: of the private random generator of start noise; None draws one.
        settings: `TaskSettings`, or plain values of its fields.
        device: where the simulations and all tensors are, `cpu` or `cuda`.
        physics: `mujoco` or `warp`; None takes what simulates on `device` best. See `physics.simulators`.
    """

    def __init__(
        self, name: str | Furniture, num_sims: int = 1, subtask: int | None = None, nthread: int = 0,
        seed: int | None = None, settings: TaskSettings | Mapping[str, Any] | None = None,
        device: str | torch.device = "cpu", physics: str | None = None,
    ):  # fmt: skip
        self.furniture = name if isinstance(name, Furniture) else library.load(name)
        self.name = name = self.furniture.name
        numbered = isinstance(subtask, int) and not isinstance(subtask, bool)
        if subtask is not None and not (numbered and 0 <= subtask < len(self.furniture.steps)):
            raise ValueError(
                f"subtask of {name} must be None (the whole task) or in 0..{len(self.furniture.steps) - 1}, "
                f"got {subtask!r}"
            )
        num_sims = whole_number("the number of simulations", num_sims, 1)
        nthread = whole_number("nthread (0: all cores)", nthread, 0)
        self.settings = (
            settings if isinstance(settings, TaskSettings) else TaskSettings.from_mapping(settings or {})
        )
        self.subtask, self.num_sims = subtask, num_sims
        self.model = build_model(self.furniture)
        self.physics = make_physics(self.model, num_sims, nthread, device, physics)
        self.generator = torch.Generator()
        self.task = Assembly(self.furniture, self.physics, subtask, self.settings, self.generator)
        self.seed(seed)
        self.state = self.task.new_state()
        self._editor = StateEditor(self.model, self.task.tables)
        self._check = SnapshotCheck(name, self.model, self.task.tables, self.state)
        self.failures = 0

    @property
    def num_subtasks(self) -> int:
        return len(self.furniture.steps)

    @property
    def max_steps(self) -> int:
        """Control steps after which an episode is truncated."""
        return self.task.step_limit

    @property
    def num_observations(self) -> int:
        return NUM_OBSERVATIONS_ROBOT + 7 * len(self.furniture.parts) + len(PHASES)

    @property
    def arguments(self) -> dict[str, Any]:
        """Plain values that build this environment again, less the seed and the number of simulations."""
        return {"task": self.name, "subtask": self.subtask, **dataclasses.asdict(self.settings)}

    def seed(self, seed: int | None) -> int:
        """Seeds the private generator and returns the seed used."""
        self.task.starts.forget()
        if seed is None:
            return self.generator.seed()
        self.generator.manual_seed(seed)
        return seed

    def reset(self, mask: Tensor | None = None) -> None:
        """Starts new episodes in the simulations of `mask` (N,), by default all."""
        failures = self.task.starts.failures
        self.task.initialize_episode(self.state, self._all() if mask is None else mask)
        self.failures += self.task.starts.failures - failures

    def reset_to(self, snapshot: TensorDict, mask: Tensor | None = None) -> None:
        """Starts new episodes from snapshots, at the beginning of the subtask that each is at.

        Raises:
            ValueError: a snapshot is not one of these simulations, is at another subtask than the environment's, or has
                nothing left to assemble.
        """
        mask = self._all() if mask is None else mask
        snapshot = self._checked(snapshot, mask)
        self._check_subtask(snapshot["task", "subtask"][mask])
        self._put(snapshot, mask)
        self.task.begin_subtask(self.state, mask)
        self.task.begin_episode(self.state, mask)

    def step(self, action: Tensor) -> None:
        """One control step (0.1 s) of every simulation under actions (N, 9); values are clipped to [-1, 1]."""
        if action.shape != (self.num_sims, NUM_ACTIONS):
            raise ValueError(
                f"an action of {self.name} has shape ({self.num_sims}, {NUM_ACTIONS}): 7 joint velocities, gripper, "
                f"connect for each simulation; got {tuple(action.shape)}"
            )
        action = action.to(torch.float64).clamp(-1.0, 1.0)
        bad = action.isnan().any(dim=-1)
        if bool(bad.any()):
            raise ValueError(
                f"an action of {self.name} is NaN in simulations {bad.nonzero().flatten().tolist()[:8]}"
            )
        self.task.before_step(self.state, action)
        failed = self.physics.step(SUBSTEPS)
        if bool(failed.any()):
            self._bury(failed)
        self.task.after_step(self.state, action, failed)

    def observation(self) -> Tensor:
        """Observation (N, O), float64; O is 37 and 7 for each part. Source: environment.md, "Observation"."""
        return self.task.get_observation(self.state)

    def expert(self) -> Assembler:
        """The scripted assembly policy on these simulations."""
        return Assembler(self.task, self.physics)

    def snapshot(self) -> TensorDict:
        """Everything that decides the future of each simulation but the random generator."""
        return TensorDict(
            {
                "physics": self.physics.state(),
                "welds": self.physics.eq_data.clone(),
                "task": self.state.clone(),
            },
            [self.num_sims],
        )

    def restore(self, snapshot: TensorDict, mask: Tensor | None = None) -> None:
        """Puts the simulations of `mask` into the states of `snapshot` (batch N), which any simulator took.

        Raises:
            ValueError: it is no snapshot of so many simulations of this furniture; see `snapshot_check`.
        """
        mask = self._all() if mask is None else mask
        self._put(self._checked(snapshot, mask), mask)

    def qpos_of(self, snapshot: TensorDict) -> Tensor:
        """Joint positions (n, nq) of snapshots [n]; see `state_edit`."""
        return self._editor.qpos_of(snapshot)

    def with_qpos(self, snapshot: TensorDict, qpos: Tensor) -> tuple[TensorDict, Tensor]:
        """Snapshots [n] at positions (n, nq), and which are possible, (n,); see `state_edit`."""
        return self._editor.with_qpos(snapshot, qpos)

    def _checked(self, snapshot: TensorDict, mask: Tensor) -> TensorDict:
        """The snapshot on the device of the simulations; raises for one that is not theirs in a row of `mask`."""
        self._check.layout(snapshot)
        if snapshot["physics"].device != self.physics.device:
            snapshot = snapshot.to(self.physics.device)
        self._check.furniture(snapshot, mask)
        return snapshot

    def _put(self, snapshot: TensorDict, mask: Tensor) -> None:
        self.physics.set_state(snapshot["physics"], snapshot["welds"], mask)
        assign(self.state, snapshot["task"].select(*self.state.keys()), mask)

    def _check_subtask(self, found: Tensor) -> None:
        wrong = found >= self.num_subtasks if self.subtask is None else found != self.subtask
        if bool(wrong.any()):
            asked = "the whole task" if self.subtask is None else f"subtask {self.subtask}"
            raise ValueError(
                f"episodes of {asked} of {self.name} cannot start from snapshots of subtask "
                f"{found[wrong][0].item()}; take states in which a subtask of theirs begins"
            )

    def _bury(self, failed: Tensor) -> None:
        """Counts failed simulations and gives them a valid state to wait in for their reset."""
        self.failures += int(failed.sum())
        self.physics.clear(failed)
        self.physics.forward(failed)

    def _all(self) -> Tensor:
        return torch.ones(self.num_sims, dtype=torch.bool, device=self.physics.device)
