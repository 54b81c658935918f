"""An environment of torch alone with the keys of `FurnitureEnv`, for tests of the learning side."""

import copy
import os
import sys
from pathlib import Path

import pytest
import torch
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf
from tensordict import TensorDict
from torchrl.data import Bounded, Categorical, Composite, Unbounded
from torchrl.envs import EnvBase

from tstar_envs.furniture.library import FURTHER
from tstar_rl.config.command_line import FULL_ERROR
from tstar_rl.config.values import CONFIGS
from tstar_rl.runs import versions

pytest_plugins = [
    "recipe_runs",
    "chain_runs",
    "chair_file",
    "point_runs",
]  # recipe_runs before those that import it

ROOT = Path(__file__).resolve().parents[1]
OF_THE_USER = tuple(f"{ROOT / name}/" for name in ("results", "runs", "demonstrations", "outputs"))
PUBLISHED = f"{ROOT / 'results' / 'published'}/"


def refuse_files_of_the_user(event: str, arguments: tuple) -> None:
    """Stops a test that reads or writes what a user's runs in this checkout leave, while they run or afterwards."""
    if event not in ("open", "os.scandir", "os.listdir", "os.mkdir", "os.remove", "os.rename"):
        return
    if isinstance(arguments[0], (str, Path)):
        path = f"{Path.cwd() / arguments[0]}/"
        if path.startswith(OF_THE_USER) and not path.startswith(PUBLISHED) and path not in OF_THE_USER:
            raise PermissionError(f"{path[:-1]} belongs to whoever runs recipes here: a test takes tmp_path")


sys.addaudithook(refuse_files_of_the_user)


@pytest.fixture(autouse=True)
def one_torch_thread():
    """TorchRL leaves two behind where it had processes; networks as small as the tests' then wait for each other."""
    torch.set_num_threads(1)


@pytest.fixture(scope="session", autouse=True)
def configs_are_parsed_once():
    """Composing takes most of its time to read and merge the same files anew, and tests compose hundreds."""
    load, parsed = OmegaConf.load, {}
    parse_rule, rules = OverridesParser.parse_rule, {}
    merge, merged = ConfigLoaderImpl._compose_config_from_defaults_list, {}

    def once(file):
        name = str(getattr(file, "name", file))
        if not name.startswith(f"{CONFIGS}/"):
            return load(file)
        parsed[name] = parsed.get(name) or load(file)
        return copy.deepcopy(parsed[name])

    def parsed_rule(parser, text, rule):
        if (text, rule) not in rules:
            rules[text, rule] = parse_rule(parser, text, rule)
        return copy.copy(rules[text, rule])  # it is then told who has parsed it

    def merged_once(loader, defaults, repo):
        """A list of files, before overrides of single values."""
        sources = {
            (one.provider, one.path) for one in repo.get_sources() if one.provider not in ("hydra", "schema")
        }
        if sources != {("main", str(CONFIGS))}:
            return merge(loader, defaults, repo)  # configs of a user's own, or of a commit
        names = ("config_path", "parent", "package", "is_self", "primary", "override_key")
        key = tuple(tuple(getattr(one, name) for name in names) for one in defaults)
        if key not in merged:
            merged[key] = merge(loader, defaults, repo)
        return copy.deepcopy(merged[key])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ConfigLoaderImpl, "_compose_config_from_defaults_list", merged_once)
        patch.setattr(OmegaConf, "load", staticmethod(once))
        patch.setattr(OverridesParser, "parse_rule", parsed_rule)
        yield


@pytest.fixture(scope="session", autouse=True)
def git_is_asked_once():
    """Every run asks it for the commit, and no test changes this checkout."""
    ask, said = versions._git, {}

    def once(folder: Path, *question: str) -> str:
        if not folder.is_relative_to(ROOT):  # a checkout of a test's own
            return ask(folder, *question)
        asked = (folder, *question, os.environ.get("PATH"))  # without it there is no git
        if asked not in said:
            said[asked] = ask(folder, *question)
        return said[asked]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(versions, "_git", once)
        yield


@pytest.fixture(scope="session", autouse=True)
def files_need_not_reach_the_disk():
    """No test cuts the power, and each checkpoint would wait for the disk a dozen times."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda handle: None)
        yield


def pytest_configure() -> None:
    """One thread from the first import on, and nothing of what a user has set for recipes of his own."""
    torch.set_num_threads(1)
    for name in (FULL_ERROR, FURTHER):
        os.environ.pop(name, None)


def pytest_collection_modifyitems(items) -> None:
    """Skips what needs a GPU where there is none."""
    if torch.cuda.is_available():
        return
    for item in items:
        if item.get_closest_marker("gpu"):
            item.add_marker(pytest.mark.skip(reason="no CUDA device here"))


class PointEnv(EnvBase):
    """A point on a line: action 0 moves it, past 1 is a success, below -1 a failure.

    Observation 0 is the position, 1 the steps taken; the other seventy are zero. Snapshots hold them. An episode is
    truncated after `max_steps`. Starts injected at ("start", "snapshot") are used where ("start", "use").
    """

    num_subtasks = 2

    def __init__(self, num_envs: int = 3, snapshots: bool = True, max_steps: int = 8, seed: int = 0) -> None:
        super().__init__(batch_size=[num_envs])
        self.snapshots, self.max_steps = snapshots, max_steps
        self.generator = torch.Generator().manual_seed(seed)
        n = num_envs
        snapshot = Composite(
            physics=Unbounded((n, 4), dtype=torch.float64),
            welds=Unbounded((n, 2, 11), dtype=torch.float64),
            task=Composite(steps=Unbounded((n,), dtype=torch.int64), shape=[n]),
            shape=[n],
        )
        self.observation_spec = Composite(
            observation=Unbounded((n, 72)),
            subtask=Unbounded((n, 1), dtype=torch.int64),
            phase=Unbounded((n, 1), dtype=torch.int64),
            success=Categorical(2, (n, 1), dtype=torch.bool),
            completed=Unbounded((n, 1), dtype=torch.int64),
            **({"snapshot": snapshot} if snapshots else {}),
            shape=[n],
        )
        self.action_spec = Bounded(-1, 1, (n, 9))
        self.reward_spec = Composite(reward_env=Unbounded((n, 1)), shape=[n])
        flag = Categorical(2, (n, 1), dtype=torch.bool)
        self.done_spec = Composite(
            done=flag.clone(), terminated=flag.clone(), truncated=flag.clone(), shape=[n]
        )
        self.physics = torch.zeros(n, 4, dtype=torch.float64)
        self.steps = torch.zeros(n, dtype=torch.int64)

    def _set_seed(self, seed: int | None) -> None:
        self.generator.manual_seed(seed or 0)

    def snapshot(self) -> TensorDict:
        n = self.batch_size[0]
        welds = torch.zeros(n, 2, 11, dtype=torch.float64)
        task = TensorDict({"steps": self.steps.clone()}, [n])
        return TensorDict({"physics": self.physics.clone(), "welds": welds, "task": task}, [n])

    def qpos_of(self, snapshot: TensorDict) -> torch.Tensor:
        return snapshot["physics"][:, :2]

    def one_sided(self, qpos: torch.Tensor) -> torch.Tensor:
        return qpos

    def with_qpos(self, snapshot: TensorDict, qpos: torch.Tensor) -> tuple[TensorDict, torch.Tensor]:
        snapshot = snapshot.clone()
        snapshot["physics"][:, :2] = qpos
        return snapshot, qpos[:, 0] < 1.5

    def _out(self, success: torch.Tensor, terminated: torch.Tensor, truncated: torch.Tensor) -> TensorDict:
        n = self.batch_size[0]
        obs = torch.zeros(n, 72)
        obs[:, 0], obs[:, 1] = self.physics[:, 0].float(), self.steps.float()
        zero = torch.zeros(n, 1, dtype=torch.int64)
        out = TensorDict({"observation": obs, "subtask": zero, "phase": zero.clone()}, [n])
        out["success"], out["completed"] = success.unsqueeze(-1), success.unsqueeze(-1).long()
        out["terminated"], out["truncated"] = terminated.unsqueeze(-1), truncated.unsqueeze(-1)
        out["done"] = out["terminated"] | out["truncated"]
        if self.snapshots:
            out["snapshot"] = self.snapshot()
        return out

    def _reset(self, tensordict: TensorDict | None = None, **kwargs) -> TensorDict:
        rows = torch.ones(self.batch_size, dtype=torch.bool)
        if tensordict is not None and tensordict.get("_reset", None) is not None:
            rows = tensordict["_reset"].reshape(-1)
        own = 0.2 * torch.rand(self.batch_size, generator=self.generator, dtype=torch.float64)
        self.physics[rows] = torch.zeros(4, dtype=torch.float64)
        self.physics[rows, 0] = own[rows]
        self.steps[rows] = 0
        start = None if tensordict is None else tensordict.get("start", None)
        if start is not None:
            use = rows & start["use"].squeeze(-1)
            self.physics[use] = start["snapshot", "physics"][use]
        no = torch.zeros(self.batch_size, dtype=torch.bool)
        return self._out(no, no, no)

    def _step(self, tensordict: TensorDict) -> TensorDict:
        move = tensordict["action"][:, 0].clamp(-1, 1).double()
        self.physics[:, 0] += 0.5 * move
        self.steps += 1
        success, failure = self.physics[:, 0] > 1, self.physics[:, 0] < -1
        out = self._out(success, success | failure, self.steps >= self.max_steps)
        out["reward_env"] = move.float().unsqueeze(-1) + 10.0 * out["success"]
        return out


@pytest.fixture
def make_env():
    """Makes a `PointEnv`."""
    return PointEnv


def forward_policy(tensordict: TensorDict) -> TensorDict:
    """Moves 0.4 forward a step: succeeds in two or three steps from the environment's own starts."""
    return tensordict.set("action", torch.full((*tensordict.batch_size, 9), 0.8))


@pytest.fixture
def policy():
    """A policy that succeeds in two or three steps."""
    return forward_policy
