"""Environments with the transforms that training needs, and rollouts that resume bit for bit.

`ray_collection.py` has the same rollouts from workers of a cluster.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.collectors import Collector
from torchrl.envs import EnvBase, StepCounter, TransformedEnv

from tstar_rl.starts import gaussian_counts
from tstar_rl.transforms import EpisodeStart, SkillChainReset
from tstar_rl.transforms.skill_chain_reset import Starts

__all__ = [
    "COLLECTOR",
    "PURPOSES",
    "Collection",
    "counts_of",
    "derive_seed",
    "load_state",
    "rollout_metrics",
    "run_episodes",
    "state_of",
    "with_starts",
]

COLLECTOR: dict[str, Any] = {
    "total_frames": -1,
    "track_traj_ids": False,
    "use_buffers": False,
    "trust_policy": True,
    "auto_register_policy_transforms": False,
}
"""What every collector here is made with: rows of a rollout are used once, and belong to the recipe."""

PURPOSES = (
    "train",
    "validate",
    "harvest",
    "evaluate",
    "demonstrate",
    "networks",
    "updates",
)


def derive_seed(seed: int, purpose: str, *index: int | None) -> int:
    """A seed for a purpose and index of a run: what trains and what chooses never sees what is reported.

    Purposes have seeds of their own. Within one, the same index is the same seed, whatever it counts and whichever
    system asks: turn i of a chain trains with the seed that subtask i was trained with. An index of None, the whole
    task, is 99; an index that is left out is 0.
    """
    if purpose not in PURPOSES:
        raise ValueError(f"purpose must be one of {', '.join(PURPOSES)}; got {purpose!r}")
    words = np.random.SeedSequence(
        [seed, PURPOSES.index(purpose), *(99 if i is None else i for i in index)]
    ).generate_state(1)
    return int(words[0]) % 2**31


def with_starts(
    env: EnvBase, starts: Starts | None = None, probability: float = 0.8, seed: int = 0
) -> TransformedEnv:
    """The environment with s_0 and the step count on every row, a share of its episodes beginning in `starts`."""
    env = TransformedEnv(env, StepCounter())
    env.append_transform(EpisodeStart())
    if starts is not None:
        env.append_transform(SkillChainReset(starts, probability, seed))
    return env


class Collection:
    """Rollouts of a policy, `horizon` steps of every simulation at a time, episodes going on from one to the next.

    TorchRL's `Collector` in this process. `settle` puts the environment through its own saved state: a restored
    simulator differs from one that went on by rounding (sleep timers are not part of a state), so a run that is
    to resume bit for bit settles whenever it saves.

    Args:
        env: batch [N].
        policy: reads and writes TensorDicts.
        horizon: steps T of each simulation in one rollout.
    """

    def __init__(self, env: TransformedEnv, policy: Callable, horizon: int) -> None:
        self.env = env
        self.collector = Collector(
            env,
            policy,
            frames_per_batch=env.batch_size.numel() * horizon,
            **COLLECTOR,
        )

    @torch.no_grad()
    def rollout(self) -> TensorDictBase:
        """The next rollout, batch [N, T]."""
        return self.collector.rollout()

    def settle(self) -> None:
        """Loads the state that `state_dict` gives."""
        self.load_state_dict(self.state_dict())

    def state_dict(self) -> dict[str, Any]:
        """Simulations, generators and the last observations."""
        return state_of(self.collector)

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """What `state_dict` gave."""
        load_state(self.collector, state)

    def counts(self) -> dict[str, int]:
        """See `counts_of`."""
        return counts_of(self.env)

    def close(self) -> None:
        """Frees the simulations."""
        self.collector.shutdown()


def counts_of(env: TransformedEnv) -> dict[str, int]:
    """What is logged of an environment since it was made: what its Gaussian has drawn, and simulations that failed.

    "failures" is there once there are some.
    """
    failures = getattr(env.base_env, "failures", 0)
    return gaussian_counts(env) | ({"failures": failures} if failures else {})


def state_of(collector: Collector) -> dict[str, Any]:
    """Simulations, generators and last observations of a collector whose environment is `with_starts`."""
    env: Any = collector.env
    world = env.base_env.state_dict()
    world = {k: v.to_dict() if isinstance(v, TensorDictBase) else v for k, v in world.items()}
    return {
        "world": world,
        "transforms": env.transform.state_dict(),
        "carried": collector._carrier.clone().to_dict(),
    }


def load_state(collector: Collector, state: dict[str, Any]) -> None:
    """What `state_of` gave."""
    env: Any = collector.env
    batch, device = env.batch_size, env.device
    world = {
        k: TensorDict.from_dict(v, batch_size=batch, device=device) if isinstance(v, dict) else v
        for k, v in state["world"].items()
    }
    env.base_env.load_state_dict(world)
    env.transform.load_state_dict(state["transforms"])
    collector._carrier = TensorDict.from_dict(state["carried"], batch_size=batch, device=device)


@torch.no_grad()
def run_episodes(
    env: TransformedEnv,
    policy: Callable,
    each_step: Callable[[TensorDictBase], None] | None = None,
) -> TensorDictBase:
    """One whole episode of every simulation, from a reset.

    Args:
        env: from `with_starts`.
        policy: reads and writes TensorDicts; how it samples is the caller's affair.
        each_step: called with every step's TensorDict, batch [N].

    Returns:
        The last step of each episode, batch [N], in the order of the simulations.
    """
    tensordict = env.reset()
    running = torch.ones(env.batch_size, dtype=torch.bool, device=tensordict.device)
    last: TensorDictBase | None = None
    while running.any():
        tensordict = env.step(policy(tensordict))
        if each_step is not None:
            each_step(tensordict)
        ended = running & tensordict["next", "done"].squeeze(-1)
        if last is None:
            last = tensordict.clone()
        elif ended.any():
            last[ended] = tensordict[ended]
        running &= ~ended
        tensordict = env.step_mdp(tensordict)
    assert last is not None
    return last


def rollout_metrics(rollout: TensorDictBase) -> dict[str, float]:
    """What is logged of a rollout (N, T): its finished episodes, phases and rewards by term."""
    following: TensorDictBase = rollout["next"]
    done = following["done"]
    episodes = int(done.sum())
    log: dict[str, float] = {
        "episodes": episodes,
        "success_rate": float(following["success"][done].float().mean()) if episodes else float("nan"),
        "completed": float(following["completed"][done].float().mean()) if episodes else float("nan"),
        "episode_length": float(following["step_count"][done].float().mean()) if episodes else float("nan"),
        "phase": float(following["phase"].float().mean()),
    }
    for name in ("reward_env", "reward_gail", "reward_tsr", "reward"):
        if name in following.keys():  # pyright: ignore[reportAttributeAccessIssue]
            log[name] = float(following[name].mean())
    if "reward_tsr" in log:
        paid = following["reward_tsr"][following["success"]]
        log["tsr_on_success"] = float(paid.mean()) if len(paid) else float("nan")
    return log
