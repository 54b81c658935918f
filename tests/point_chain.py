"""A chain of four subtasks on a point, which trains in seconds."""

import functools
import shutil
import tempfile
from pathlib import Path

import torch
from tensordict import TensorDict
from torchrl.data import Binary, Bounded, Composite, Unbounded
from torchrl.envs import EnvBase

from tstar_rl.chaining.skill import Skill
from tstar_rl.models.network_settings import NetworkSettings

SUBTASKS = 4
NETWORKS = NetworkSettings(
    hidden=(16,), discriminator_hidden=(16,), std="fixed", action_std=0.3, hand_std=0.3
)


class PointChain(EnvBase):
    """A point that walks along x; subtask k ends at x > k + 1, and from subtask 1 on it succeeds only if y > 0 there.

    Observation 0 is x and 1 is y; the others are zero. Action 0 moves x, action 1 moves y. Skill 0's own starts have y
    on both sides of 0, those of the others y > 0.2: a skill that was trained on its own starts fails half of the time
    from where skill 0 ends.
    """

    num_subtasks = SUBTASKS
    pace = 1.0
    """Of both actions. At 1 an episode takes three steps; at 0.05 it takes as many as an episode of the furniture."""

    def __init__(
        self, task: str, num_envs: int = 1, subtask: int | None = None, seed: int = 0,
        snapshots: bool = False, max_steps: int = 8, **settings,
    ):  # fmt: skip
        super().__init__(batch_size=[num_envs])
        self.subtask, self.snapshots = subtask, snapshots
        self.max_steps = max_steps * (SUBTASKS if subtask is None else 1)
        self.generator = torch.Generator().manual_seed(seed)
        n = num_envs
        self.physics = torch.zeros(n, 4, dtype=torch.float64)
        self.now, self.steps, self.completed = (torch.zeros(n, dtype=torch.int64) for _ in range(3))
        numbers = {name: Unbounded((n, 1), dtype=torch.int64) for name in ("subtask", "phase", "completed")}
        flags = {name: Binary(1, (n, 1), dtype=torch.bool) for name in ("done", "terminated", "truncated")}
        snapshot = Composite(
            physics=Unbounded((n, 4), dtype=torch.float64),
            task=Composite(
                {name: Unbounded((n,), dtype=torch.int64) for name in ("subtask", "episode_step")}, shape=[n]
            ),
            shape=[n],
        )
        self.observation_spec = Composite(
            observation=Unbounded((n, 72)),
            success=Binary(1, (n, 1), dtype=torch.bool),
            **numbers,
            **({"snapshot": snapshot} if snapshots else {}),
            shape=[n],
        )
        self.action_spec = Bounded(-1, 1, (n, 9))
        self.reward_spec = Composite(reward_env=Unbounded((n, 1)), shape=[n])
        self.done_spec = Composite(flags, shape=[n])

    def snapshot(self) -> TensorDict:
        """What decides the future of each point."""
        task = TensorDict({"subtask": self.now.clone(), "episode_step": self.steps.clone()}, self.batch_size)
        return TensorDict({"physics": self.physics.clone(), "task": task}, self.batch_size)

    def state_dict(self, *args, **kwargs) -> dict:
        """Generator and points."""
        return {
            "generator": self.generator.get_state(),
            "points": self.snapshot(),
            "counts": torch.stack([self.steps, self.completed], -1),
        }

    def load_state_dict(self, state: dict, *args, **kwargs) -> None:
        self.generator.set_state(state["generator"])
        self.physics.copy_(state["points"]["physics"])
        self.now.copy_(state["points"]["task", "subtask"])
        for number, mine in enumerate((self.steps, self.completed)):
            mine.copy_(state["counts"][:, number])

    def _set_seed(self, seed: int | None) -> None:
        self.generator.manual_seed(seed or 0)

    def qpos_of(self, snapshot: TensorDict) -> torch.Tensor:
        return snapshot["physics"][:, :2]

    def one_sided(self, qpos: torch.Tensor) -> torch.Tensor:
        return qpos

    def with_qpos(self, snapshot: TensorDict, qpos: torch.Tensor) -> tuple[TensorDict, torch.Tensor]:
        snapshot = snapshot.clone()
        snapshot["physics"][:, :2] = qpos
        return snapshot, torch.ones(len(qpos), dtype=torch.bool)

    def _reset(self, tensordict: TensorDict | None = None, **kwargs) -> TensorDict:
        n = self.batch_size[0]
        rows = torch.ones(n, dtype=torch.bool)
        if tensordict is not None and tensordict.get("_reset", None) is not None:
            rows = tensordict["_reset"].reshape(-1)
        first = self.subtask or 0
        own = torch.zeros(n, 4, dtype=torch.float64)
        own[:, 0] = first + 0.2 * torch.rand(n, generator=self.generator, dtype=torch.float64)
        side = torch.rand(n, generator=self.generator, dtype=torch.float64)
        own[:, 1] = 2 * side - 1 if first == 0 else 0.2 + 0.8 * side
        self.physics[rows], self.now[rows] = own[rows], first
        self.steps[rows], self.completed[rows] = 0, 0
        start = None if tensordict is None else tensordict.get("start", None)
        if start is not None:
            use = rows & start["use"].squeeze(-1)
            self.physics[use] = start["snapshot", "physics"][use]
            self.now[use] = start["snapshot", "task", "subtask"][use]
            if "goes_on" in start:
                self.completed[use] = self.now[use]
                self.steps[use] = start["snapshot", "task", "episode_step"][use]
            assert self.subtask is None or bool((self.now[use] == self.subtask).all())
        no = torch.zeros(n, dtype=torch.bool)
        return self._out(no, no, no)

    def _step(self, tensordict: TensorDict) -> TensorDict:
        action = tensordict["action"].clamp(-1, 1).double()
        running = tensordict.get("_step", None)
        running = torch.ones_like(self.now) if running is None else running.reshape(-1).long()
        self.physics[:, 0] += running * 0.5 * self.pace * action[:, 0]
        self.physics[:, 1] += running * 0.3 * self.pace * action[:, 1]
        self.steps += running
        arrived = self.physics[:, 0] > self.now + 1
        made = arrived & ((self.physics[:, 1] > 0) | (self.now == 0))
        lost = (arrived & ~made) | (self.physics[:, 0] < self.now - 1)
        last = SUBTASKS - 1 if self.subtask is None else self.subtask
        success = made & (self.now == last)
        self.now += made
        self.completed += made
        out = self._out(success, success | lost, self.steps >= self.max_steps)
        out["reward_env"] = action[:, :1].float() + 100.0 * made.unsqueeze(-1)
        return out

    def _out(self, success: torch.Tensor, terminated: torch.Tensor, truncated: torch.Tensor) -> TensorDict:
        n = self.batch_size[0]
        observation = torch.zeros(n, 72)
        observation[:, :2] = self.physics[:, :2].float()
        out = TensorDict({"observation": observation}, [n])
        numbers = {"subtask": self.now, "phase": torch.zeros_like(self.now), "completed": self.completed}
        for name, value in {**numbers, "success": success, "terminated": terminated}.items():
            out[name] = value.clone().unsqueeze(-1)
        out["truncated"] = (truncated & ~terminated).unsqueeze(-1)
        out["done"] = out["terminated"] | out["truncated"]
        if self.snapshots:
            out["snapshot"] = self.snapshot()
        return out


def make_skills(folder: Path) -> None:
    """Four skills that walk forward and leave y alone, as a first stage would have left them."""
    shutil.copytree(_made_skills().name, folder, dirs_exist_ok=True)


@functools.cache
def _made_skills() -> tempfile.TemporaryDirectory[str]:
    """Where they are made, once for all tests of a process."""
    folder = tempfile.TemporaryDirectory()
    for index in range(SUBTASKS):
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(index)
            skill = Skill("table_lack", index, NETWORKS)
        spread = torch.linspace(-1, 1, 100).unsqueeze(-1) * torch.ones(100, 72)
        spread[:, 0] += index + 0.5
        skill.normalizer.fit(spread, 0.5)
        head = skill.policy[0][1].module[0][-1]  # the last linear layer
        torch.nn.init.zeros_(head.weight)
        head.bias.data[0] = 1.0
        skill.save(Path(folder.name, f"runs/table_lack/gail_ppo/seed0/subtask{index}/last"))
    return folder
