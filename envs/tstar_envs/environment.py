"""The batched environment under every front: N simulations, one task, their random numbers and snapshots."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Mapping
from typing import Any

import mujoco
import torch
from tensordict import TensorDict
from torch import Tensor

from tstar_envs.checks import subtask_number, whole_number
from tstar_envs.experts.assembler import Assembler
from tstar_envs.furniture import Furniture, library
from tstar_envs.look import build_drawn_model
from tstar_envs.physics.masks import write
from tstar_envs.physics.simulators import make_physics
from tstar_envs.physics.view import PhysicsView
from tstar_envs.scene import SUBSTEPS, build_model
from tstar_envs.settings import TaskSettings
from tstar_envs.snapshot_check import SnapshotCheck
from tstar_envs.state_edit import StateEditor
from tstar_envs.tasks.actions import NUM_ACTIONS, read_actions, read_mask
from tstar_envs.tasks.assembly import Assembly, assign
from tstar_envs.tasks.begun import Begun
from tstar_envs.tasks.phase_reward import PHASES

NUM_OBSERVATIONS_ROBOT = 29


class BatchedEnvironment:
    """N simulations of one assembly task.

    `reset(mask)` and `step(actions)` leave what happened in `state` (see `tasks.assembly`); `observation()` reads it.
    Both compute in PyTorch's inference mode, which saves a fifth of the time of one simulation: tensors in `state` are
    inference tensors, which nobody may write into. What `observation()` and `snapshot()` give are ordinary ones.

    A simulation that MuJoCo gives up on ends its own episode as a failure, is counted in `failures` and waits for a
    reset, failed and unpaid, also if it is stepped; the others do not notice. One that fails while an episode's start
    settles is counted too, and drawn again.

    Args:
        name: furniture, e.g. `table_lack`, or a piece that is not in the library.
        num_sims: how many simulations.
        subtask: step of the recipe, 0-based, or None for the whole task.
        nthread: threads that step the simulations, 0 for all cores. Results do not depend on it.
        seed: of the private random generator of start noise; None draws one.
        settings: `TaskSettings`, or plain values of its fields.
        device: where the simulations and all tensors are, `cpu` or `cuda`.
        physics: `mujoco` or `warp`; None takes what simulates on `device` best. See `physics.simulators`. Or `num_sims`
            simulations of the furniture's scene, ready made; `device` and `nthread` do not count then.
    """

    def __init__(
        self, name: str | Furniture, num_sims: int = 1, subtask: int | None = None, nthread: int = 0,
        seed: int | None = None, settings: TaskSettings | Mapping[str, Any] | None = None,
        device: str | torch.device = "cpu", physics: str | PhysicsView | None = None,
    ):  # fmt: skip
        self.furniture = name if isinstance(name, Furniture) else library.load(name)
        self.name = name = self.furniture.name
        subtask = subtask_number(name, subtask, len(self.furniture.steps))
        num_sims = whole_number("the number of simulations", num_sims, 1)
        nthread = whole_number("nthread (0: all cores)", nthread, 0)
        self.settings = (
            settings if isinstance(settings, TaskSettings) else TaskSettings.from_mapping(settings or {})
        )
        self.subtask, self.num_sims = subtask, num_sims
        if physics is None or isinstance(physics, str):
            physics = make_physics(build_model(self.furniture), num_sims, nthread, device, physics)
        elif physics.num_sims != num_sims:
            raise ValueError(f"physics has {physics.num_sims} simulations, and num_sims is {num_sims}")
        self.physics, self.model = physics, physics.model
        self.generator = torch.Generator()
        self.task = Assembly(self.furniture, self.physics, subtask, self.settings, self.generator)
        self.seed(seed)
        self.state = self.task.new_state()
        self._editor = StateEditor(self.model, self.task.tables)
        self._check = SnapshotCheck(name, self.model, self.task.tables, num_sims, self.state)
        self.failures = 0
        self._begun = Begun(name, self._all())

    @property
    def num_subtasks(self) -> int:
        return len(self.furniture.steps)

    @functools.cached_property
    def drawn_model(self) -> mujoco.MjModel:
        """The scene to draw: the same joints as `model`, and more to see. See `tstar_envs.look`."""
        return build_drawn_model(self.furniture)

    @property
    def max_steps(self) -> int:
        """Control steps after which an episode is truncated: of the whole task K times the setting of this name."""
        return self.task.step_limit

    @property
    def num_observations(self) -> int:
        return NUM_OBSERVATIONS_ROBOT + 7 * len(self.furniture.parts) + len(PHASES)

    @property
    def arguments(self) -> dict[str, Any]:
        """Plain values of this environment, as `GymnasiumEnv`, `load_dm` and a TorchRL wrapper take them.

        They lack the seed, the number of simulations, the device and its physics. Of furniture that was built in
        Python, or read from a file elsewhere, they have the name alone.
        """
        return {"task": self.name, "subtask": self.subtask, **dataclasses.asdict(self.settings)}

    def seed(self, seed: int | None) -> int:
        """Seeds the private generator and returns the seed used; None draws one.

        Raises:
            ValueError: it is no whole number from 0 to 2**64 - 1.
        """
        self.task.starts.forget()
        if seed is None:
            return self.generator.seed()
        seed = whole_number("seed", seed, 0, 2**64 - 1)
        self.generator.manual_seed(seed)
        return seed

    @torch.inference_mode()
    def reset(self, mask: Tensor | None = None) -> None:
        """Starts new episodes in the simulations of `mask` (N,), by default all; of none, nothing changes.

        Raises:
            ValueError: `mask` is of another shape or type.
            StartError: no episode can begin in some of them; all of `mask` then wait for another reset.
        """
        failures = self.task.starts.failures
        mask = self._read(mask)
        if not bool(mask.any()):
            return
        self._begun.remove(mask)
        try:
            self.task.initialize_episode(self.state, mask)
        except BaseException:  # neither the old episode is there nor a new one: as in one that was given up
            none = self.task.new_state()
            none["failed"].fill_(True)
            assign(self.state, none, mask)
            raise
        finally:  # also those of a start that never settled
            self.failures += self.task.starts.failures - failures
        self._begun.add(mask)

    @torch.inference_mode()
    def reset_to(
        self, snapshot: TensorDict, mask: Tensor | None = None, goes_on: Tensor | None = None
    ) -> None:
        """Starts new episodes at the beginning of each snapshot's subtask; where `goes_on` (N,), its own goes on.

        Raises:
            ValueError: a snapshot is not one of these simulations, is at another subtask than the environment's, has
                nothing left to assemble, was taken before a first reset or of a simulation that was given up, or one in
                `goes_on` is refused by `restore`; a mask is of another shape or type. Nothing has changed then.
        """
        mask = self._read(mask)
        begins = mask if goes_on is None else mask & ~self._read(goes_on)
        snapshot = self._checked(snapshot, mask)
        self._check.has_episode(snapshot, mask)
        self._check.begins(snapshot, begins, self.subtask)
        self._check.goes_on(snapshot, mask & ~begins, self.subtask)
        self._put(snapshot, mask)
        self.task.begin_subtask(self.state, begins)
        self.task.begin_episode(self.state, begins)

    @torch.inference_mode()
    def step(self, action: Tensor, running: Tensor | None = None) -> None:
        """One control step (0.1 s) under actions (N, 9); values are clipped to [-1, 1].

        Args:
            action: (N, 9).
            running: (N,) bool, the simulations to step, by default all. The others keep their state and whatever
                their last step did, their actions are not read, and on the CPU they cost no physics. Those that run
                do what they would do among all, to the bit.

        Raises:
            ValueError: actions or `running` of another shape, or an action that is NaN; no episode was begun yet.
            RuntimeError: on a GPU, where contacts were lost; see `physics.warp`.
        """
        if running is None:
            action = self.before_step(action)
            return self.after_step(action, self.physics.step(SUBSTEPS))
        running = self._read(running)
        if isinstance(action, Tensor) and action.shape == (self.num_sims, NUM_ACTIONS):
            action = torch.where(
                running.unsqueeze(-1), action.to(running.device), 0.0
            )  # 0 does not ask to connect
        state, controls = dict(self.state), self.physics.ctrl.clone()
        action = self.before_step(action, running)
        write(self.physics.ctrl, controls, ~running)
        self.after_step(action, self.physics.step(SUBSTEPS, running))
        assign(self.state, state, ~running)

    def before_step(self, action: Tensor, running: Tensor | None = None) -> Tensor:
        """The part of a step before the simulator's: writes controls; returns the clipped actions, float64."""
        self._begun.check(running)
        action = read_actions(self.name, action, self.num_sims, self.physics.device)
        self.task.before_step(self.state, action)
        return action

    def after_step(self, action: Tensor, failed: Tensor) -> None:
        """The part of a step after the simulator's, under actions (N, 9) from `before_step`; `failed` is (N,)."""
        failed = failed | self.state["failed"]
        if bool(failed.any()):
            self._bury(failed)
        failures = self.task.starts.failures
        self.task.after_step(self.state, action, failed)
        self.failures += self.task.starts.failures - failures

    def observation(self) -> Tensor:
        """Observation (N, O), float64; O is 37 and 7 for each part. Source: docs/task.md, "Observation"."""
        return self.task.get_observation(self.state)

    def expert(self) -> Assembler:
        """The scripted assembly policy on these simulations."""
        return Assembler(self.task, self.physics)

    def snapshot(self) -> TensorDict:
        """Everything that decides the future of each simulation but the random generator.

        Two simulations that are restored from it go on alike, to the bit. Beside them, the one that it was taken of
        differs by 1e-6 and more from the first step on: it also knows which parts are about to fall asleep, which no
        state of MuJoCo holds. Source: docs/decisions/0005-physics.md.
        """
        batch = [self.num_sims]
        task = {name: value.clone() for name, value in self.state.items()}
        return TensorDict(
            {
                "physics": self.physics.state(),
                "welds": self.physics.eq_data.clone(),
                "task": TensorDict(task, batch, device=self.physics.device),
            },
            batch,
        )

    @torch.inference_mode()
    def restore(self, snapshot: TensorDict, mask: Tensor | None = None) -> None:
        """Puts the simulations of `mask` into the states of `snapshot` (batch N), which any simulator took.

        Their clocks go on: after a snapshot of the whole task an episode of one subtask may be past its time limit.
        `reset_to` begins a new episode.

        Raises:
            ValueError: it is no snapshot of so many simulations of this furniture, or is at a subtask that episodes
                here never come to; see `snapshot_check`.
        """
        mask = self._read(mask)
        snapshot = self._checked(snapshot, mask)
        self._check.goes_on(snapshot, mask, self.subtask)
        self._put(snapshot, mask)

    def qpos_of(self, snapshot: TensorDict) -> Tensor:
        """Joint positions (n, nq) of snapshots [n]; see `state_edit`."""
        return self._editor.qpos_of(snapshot)

    def one_sided(self, qpos: Tensor) -> Tensor:
        """Positions (n, nq) with the quaternions of each part on one side; see `state_edit`."""
        return self._editor.one_sided(qpos)

    def with_qpos(self, snapshot: TensorDict, qpos: Tensor) -> tuple[TensorDict, Tensor]:
        """Snapshots [n] at positions (n, nq), and which are possible, (n,); see `state_edit`."""
        return self._editor.with_qpos(snapshot, qpos)

    def _checked(self, snapshot: TensorDict, mask: Tensor) -> TensorDict:
        """The snapshot on the device of the simulations; raises for one that is not theirs in a row of `mask`."""
        self._check.layout(snapshot)
        if snapshot["physics"].device != self.physics.device:
            snapshot = snapshot.to(self.physics.device)
        self._check.values(snapshot, mask)
        self._check.furniture(snapshot, mask)
        return snapshot

    def _put(self, snapshot: TensorDict, mask: Tensor) -> None:
        self.physics.set_state(snapshot["physics"], snapshot["welds"], mask)
        task = {name: snapshot["task", name] for name in self.state}
        if self.subtask is not None:  # what an episode of one subtask completed, it did from there on
            since = (task["subtask"] - self.subtask).clamp_min(0)
            others = task["completed"] > since  # its last step ended another kind of episode, if any
            task["completed"] = torch.minimum(task["completed"], since)
            task |= {name: task[name] & ~others for name in ("success", "wrong", "disturbed")}
        assign(self.state, task, mask)
        begun = self._check.begun(snapshot)
        self._begun.remove(mask & ~begun)
        self._begun.add(mask & begun)

    def _read(self, mask: Tensor | None) -> Tensor:
        """A mask of simulations (N,) as a caller gave it; None is all of them."""
        return self._all() if mask is None else read_mask(self.name, mask, self.num_sims, self.physics.device)

    def _bury(self, failed: Tensor) -> None:
        """Gives failed simulations a valid state to wait in for their reset, and counts those that did not wait yet."""
        self.failures += int((failed & ~self.state["failed"]).sum())
        self.physics.clear(failed)
        self.physics.forward(failed)

    def _all(self) -> Tensor:
        return torch.ones(self.num_sims, dtype=torch.bool, device=self.physics.device)
