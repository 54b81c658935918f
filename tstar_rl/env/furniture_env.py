"""The furniture assembly tasks as a TorchRL environment: the one place where learning meets the world."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.envs import EnvBase

from tstar_envs.checks import finite_number, short
from tstar_envs.environment import BatchedEnvironment
from tstar_envs.settings import TaskSettings
from tstar_rl.env import showing
from tstar_rl.env.specs import furniture_specs
from tstar_rl.env.task_tables import table_geometry


class FurnitureEnv(EnvBase):
    """N simulations of an assembly task, batch size [N].

    Reads `action` (N, 9) in [-1, 1] (clipped): seven joint velocities, gripper, connect. Writes `observation`
    (N, O), `subtask`, `phase`, `completed` (N, 1) int64, `success` (N, 1) bool, the done flags, and, as its reward
    key, the unscaled `reward_env` (N, 1). With `snapshots=True` also `snapshot`, from which the simulations restart.
    The success row of a subtask holds the state in which the next subtask begins.

    `reset` accepts injected starts: `("start", "snapshot")`, batch [N], and `("start", "use")` (N, 1) bool. A new
    episode begins there, at the beginning of a subtask; with `("start", "goes_on")` (N, 1) the snapshot's own goes on.
    They count once: `reset` takes them out of the TensorDict that it was given. `reset(seed=...)` seeds first.
    This holds for the bare environment: TorchRL's `TransformedEnv` drops such entries of its caller, so through
    transforms `SkillChainReset` is the way.
    `step` accepts TorchRL's `_step` (N,) bool: simulations left out of it stay as they are and are paid 0.

    Args:
        task: furniture, e.g. `table_lack`.
        num_envs: simulations N.
        subtask: step of the recipe, 0-based; None runs the whole task, counting subtasks up in place.
        nthread: threads that step the simulations (0: all cores); results are the same bits at any number.
        device: `cpu`, or `cuda`: simulations, task and tensors are then on the GPU (extra `gpu`).
        seed: of the private generator of start noise.
        snapshots: write the snapshot of every step.
        physics: the simulator, `mujoco` or `warp`; by default `mujoco` on the CPU and `warp` on a GPU. With
            `device="cpu", physics="warp"` the GPU's simulator runs on the CPU, slowly: for tests.
        **settings: `tstar_envs.settings.TaskSettings` by name.

    Raises:
        ValueError: unknown furniture, subtask, device or simulator, a setting that cannot be; an action of another
            shape or with NaN.
        TypeError: a keyword that is no setting.
        ImportError: the simulator needs the extra `gpu`.
    """

    def __init__(
        self, task: str, num_envs: int = 1, subtask: int | None = None, nthread: int = 0,
        device: str | torch.device = "cpu", seed: int | None = None, snapshots: bool = False,
        physics: str | None = None, **settings: Any,
    ):  # fmt: skip
        chosen = TaskSettings.from_keywords(type(self).__name__, settings)
        world = BatchedEnvironment(task, num_envs, subtask, nthread, seed, chosen, device, physics)
        super().__init__(device=world.physics.device, batch_size=torch.Size([num_envs]))
        self.world = world
        self.snapshots = snapshots
        snapshot = self.snapshot() if snapshots else None
        specs = furniture_specs(self.batch_size, world.num_observations, world.num_subtasks, snapshot)
        self.observation_spec = specs.observation.to(self.device)
        self.action_spec = specs.action.to(self.device)
        self.reward_spec = specs.reward.to(self.device)
        self.done_spec = specs.done.to(self.device)

    @property
    def num_envs(self) -> int:
        return self.world.num_sims

    @property
    def subtask(self) -> int | None:
        return self.world.subtask

    @property
    def num_subtasks(self) -> int:
        return self.world.num_subtasks

    @property
    def max_steps(self) -> int:
        """Control steps after which an episode is truncated: of the whole task K times the setting of this name."""
        return self.world.max_steps

    @property
    def arguments(self) -> dict[str, Any]:
        """Plain values that build this environment again.

        They lack the seed, the number of simulations and threads, the device and its physics, and `snapshots`.
        """
        return self.world.arguments

    @property
    def failures(self) -> int:
        """Simulations that MuJoCo gave up on so far."""
        return self.world.failures

    def snapshot(self) -> TensorDict:
        """State of every simulation, batch [N]; see `tstar_envs.environment`."""
        return self.world.snapshot()

    def restore(self, snapshot: TensorDictBase, mask: Tensor | None = None) -> None:
        """Puts the simulations of `mask` (N,) into the states of `snapshot`, mid-episode."""
        self.world.restore(snapshot, mask)

    def qpos_of(self, snapshot: TensorDictBase) -> Tensor:
        """Joint positions in snapshots of batch [n]: (n, nq) float64; free bodies as position and quaternion."""
        return self.world.qpos_of(snapshot)

    def one_sided(self, qpos: Tensor) -> Tensor:
        """Joint positions (n, nq) with the quaternions of each part on one side; q and -q are one rotation."""
        return self.world.one_sided(qpos)

    def with_qpos(self, snapshot: TensorDictBase, qpos: Tensor) -> tuple[TensorDict, Tensor]:
        """Snapshots [n] at other joint positions (n, nq), at rest, and which of them are possible, (n,) bool."""
        return self.world.with_qpos(snapshot, qpos)

    def geometry(self, subtask: int) -> dict[str, Any]:
        """See `task_tables.subtask_geometry`."""
        return table_geometry(self.world.task.tables, subtask)

    def write_mp4(self, path: str | Path, positions: Tensor) -> bool:
        """See `showing.write_mp4`."""
        return showing.write_mp4(self.world, path, positions)

    def write_player(
        self, path: str | Path, episodes: Sequence[Mapping[str, Any]], title: str | None = None
    ) -> Path:
        """See `showing.write_player`."""
        return showing.write_player(self.world, path, episodes, title)

    def expert(self, noise: float = 0.0, generator: torch.Generator | None = None) -> Callable:
        """The scripted assembly policy as a map of TensorDicts, of which it reads nothing: it acts in this environment.

        Writes `action` and the clean label `expert_action` for the state that the simulations are in. With `noise`,
        Gaussian noise of that standard deviation is added to the seven arm components of `action`, drawn from
        `generator`, without one from torch's.

        Raises:
            ValueError: the noise is negative or not finite.
        """
        if (noise := finite_number("noise of the expert", noise)) < 0:
            raise ValueError(f"noise of the expert must be a finite number from 0, got {short(noise)}")
        assembler = self.world.expert()

        def act(tensordict: TensorDictBase) -> TensorDictBase:
            label = assembler.act(self.world.state).float()
            action = label.clone()
            if noise:
                action[:, :7] += noise * torch.randn(self.num_envs, 7, generator=generator).to(action.device)
            return tensordict.set("expert_action", label).set("action", action.clamp(-1.0, 1.0))

        return act

    def state_dict(self, *args, **kwargs) -> dict[str, Any]:
        """Generator and simulations: environments that are loaded with it go on alike, to the bit.

        So does this one once it is loaded with it, too; otherwise it differs by 1e-6 and more from the first step on.
        Source: docs/decisions/0005-physics.md.
        """
        return {
            "generator": self.world.generator.get_state(),
            "snapshot": self.snapshot(),
            "failures": self.failures,
        }

    def load_state_dict(self, state_dict: Mapping[str, Any], strict: bool = True, **kwargs) -> None:
        """Goes on as the environment whose state it is.

        Args:
            state_dict: what `state_dict` gave. An empty one, as in the checkpoint of a collector whose environment has
                no transforms, says nothing and changes nothing.
            strict: False, as TorchRL's `EnvCreator` has it, which shares what transforms know between workers: nothing
                is loaded then, since each worker has episodes of its own.
            **kwargs: TorchRL's.

        Raises:
            ValueError: a part of the state is missing.
        """
        if not strict or not state_dict:
            return
        if missing := [name for name in ("generator", "snapshot", "failures") if name not in state_dict]:
            raise ValueError(
                f"the state of an environment has generator, snapshot and failures, got no {', no '.join(missing)}"
            )
        self.world.restore(state_dict["snapshot"])  # first: one that is refused changes nothing
        self.world.generator.set_state(state_dict["generator"].cpu())
        self.world.task.starts.forget()
        self.world.failures = int(state_dict["failures"])

    def _reset(
        self, tensordict: TensorDictBase | None = None, *, seed: int | None = None, **kwargs
    ) -> TensorDictBase:
        if kwargs:
            raise TypeError(f"reset() got an unexpected keyword argument {next(iter(kwargs))!r}; valid: seed")
        if seed is not None:
            self._set_seed(seed)
        mask = torch.ones(self.num_envs, dtype=torch.bool, device=self.device)
        if tensordict is not None and "_reset" in tensordict:
            mask = tensordict["_reset"].reshape(self.num_envs)
        injected = torch.zeros_like(mask)
        if tensordict is not None and "start" in tensordict:
            start = cast(TensorDictBase, tensordict["start"])
            use, within = self._which(start)
            injected = mask & use
            if bool(injected.any()):  # first what may be refused
                self.world.reset_to(start["snapshot"], injected, within)
        self.world.reset(mask & ~injected)
        if tensordict is not None and "start" in tensordict:
            tensordict.pop("start")  # else it would be there, and count, at the next reset too
        return self._observe().update(self._done(~mask))

    def _which(self, start: TensorDictBase) -> tuple[Tensor, Tensor]:
        """Which simulations begin in an injected start, (N,), and which of these go on with its episode, (N,)."""
        missing = [name for name in ("snapshot", "use") if name not in start]
        if missing:
            raise ValueError(
                f"an injected start needs 'snapshot' and 'use', got no {' and no '.join(missing)}"
            )
        masks = {name: start.get(name, torch.zeros_like(start["use"])) for name in ("use", "goes_on")}
        for name, value in masks.items():
            if value.dtype != torch.bool or value.numel() != self.num_envs:
                raise ValueError(
                    f"'start.{name}' is bool, ({self.num_envs}, 1), got {value.dtype}, {tuple(value.shape)}"
                )
        return masks["use"].reshape(self.num_envs), masks["goes_on"].reshape(self.num_envs)

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        running = tensordict.get("_step", None)
        if running is not None:  # after `to`, tensors are elsewhere than the simulations
            running = running.reshape(self.num_envs).to(self.world.physics.device)
        self.world.step(tensordict["action"], running)
        out = self._observe()
        reward = self.world.task.get_reward(self.world.state)
        reward = reward if running is None else reward * running
        out.set("reward_env", reward.float().unsqueeze(-1))
        return out.update(self._done())

    def _done(self, rows: Tensor | None = None) -> dict[str, Tensor]:
        """The done flags, each (N, 1): false outside of `rows` (N,)."""
        terminated, truncated = self.world.task.get_termination(self.world.state)
        flags = {"terminated": terminated, "truncated": truncated, "done": terminated | truncated}
        if rows is not None:
            flags = {name: flag & rows.to(flag.device) for name, flag in flags.items()}
        return {name: flag.unsqueeze(-1) for name, flag in flags.items()}

    def _observe(self) -> TensorDict:
        state = self.world.state
        out = {
            name: state[name].unsqueeze(-1).clone() for name in ("subtask", "phase", "completed", "success")
        }
        out["observation"] = self.world.observation().float()
        if self.snapshots:
            out["snapshot"] = self.snapshot()
        return TensorDict(out, self.batch_size, device=self.device)

    def close(self, *, raise_if_closed: bool = True) -> None:
        """Frees what the simulators hold on a GPU; positions and snapshots can still be read."""
        self.world.physics.close()
        super().close(raise_if_closed=raise_if_closed)

    def _set_seed(self, seed: int | None) -> None:
        self.world.seed(seed)


# TorchRL's metaclass hides it from help() and from editors.
FurnitureEnv.__signature__ = inspect.signature(  # pyright: ignore[reportAttributeAccessIssue]
    functools.partial(FurnitureEnv.__init__, None)
)
