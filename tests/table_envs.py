"""The TorchRL front of the table for tests, and what they do with it."""

import torch
from tensordict import TensorDict, TensorDictBase

from tstar_rl.env.furniture_env import FurnitureEnv

KEYS = ("observation", "subtask", "phase", "success", "completed", "done", "terminated", "truncated")


def make(num_envs: int = 3, **arguments) -> FurnitureEnv:
    return FurnitureEnv("table_lack", num_envs, **{"subtask": 0, "nthread": 1, "seed": 0, **arguments})


def still(env: FurnitureEnv) -> TensorDict:
    action = torch.zeros(env.num_envs, 9)
    action[:, 7:] = -1
    return TensorDict({"action": action}, env.batch_size)


def same(a: TensorDictBase, b: TensorDictBase, rows=slice(None), keys=KEYS) -> bool:
    return all(torch.equal(a[key][rows], b[key][rows]) for key in keys)


def until_success(env: FurnitureEnv) -> TensorDict:
    """Runs the expert until a simulation succeeds; that step."""
    tensordict, expert = env.reset(), env.expert()
    for _ in range(env.max_steps):
        tensordict = env.step(expert(tensordict))
        if tensordict["next", "success"].any():
            return tensordict
        tensordict = env.step_mdp(tensordict)
    raise AssertionError("the expert did not succeed")
