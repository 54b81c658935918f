"""Environments with the transforms that training needs, and rollouts that resume bit for bit.

`ray_collection.py` has the same rollouts from workers of a cluster.
"""

from collections.abc import Callable
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.collectors import Collector
from torchrl.envs import EnvBase, StepCounter, TransformedEnv

from tstar_rl.checks import InvalidValueError
from tstar_rl.rollouts.starts import (
    gaussian_counts,
    load_state_of_sources,
    start_counts,
    state_of_sources,
)
from tstar_rl.transforms import EpisodeStart, SkillChainReset
from tstar_rl.transforms.skill_chain_reset import Starts

__all__ = ["COLLECTOR", "Collection", "counts_of", "load_state", "rollout_metrics", "state_of", "with_starts"]

COLLECTOR: dict[str, Any] = {
    "total_frames": -1,
    "track_traj_ids": False,
    "use_buffers": False,
    "trust_policy": True,
    "auto_register_policy_transforms": False,
}
"""What every collector here is made with: rows of a rollout are used once, and belong to the recipe."""


OBSERVED = ("observation", "subtask", "phase", "completed", "success")
"""What every environment here observes, beside what TorchRL's do."""


def with_starts(
    env: EnvBase,
    starts: Starts | None = None,
    probability: float = 0.8,
    seed: int = 0,
    goes_on: bool = False,
) -> TransformedEnv:
    """The environment with s_0 and the step count on every row, a share of its episodes beginning in `starts`.

    See `SkillChainReset` for the arguments.

    Raises:
        InvalidValueError: if the environment lacks one of `OBSERVED`, or "reward_env"; docs/library.md says what they
            are.
    """
    there = {*env.observation_spec.keys(), *env.full_reward_spec.keys()}
    if lacking := [name for name in (*OBSERVED, "reward_env") if name not in there]:
        raise InvalidValueError(
            f"{type(env).__name__} has no {', '.join(lacking)}; an environment of skills gives {', '.join(OBSERVED)} "
            "and reward_env (docs/library.md)"
        )
    env = TransformedEnv(env, StepCounter())
    env.append_transform(EpisodeStart())
    if starts is not None:
        env.append_transform(SkillChainReset(starts, probability, seed, goes_on))
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
    """What is logged of an environment since it was made.

    Where its episodes have begun, what its Gaussian has drawn, and "failures", simulations that failed, once there are
    some. With SPiRL these include steps after an episode's end, which no batch has: see `LatentExecution`.
    """
    failures = getattr(env.base_env, "failures", 0)
    return start_counts(env) | gaussian_counts(env) | ({"failures": failures} if failures else {})


def state_of(collector: Collector) -> dict[str, Any]:
    """Simulations, generators and last observations of a collector whose environment is `with_starts`.

    Raises:
        InvalidValueError: if the environment says nothing of its state: a run could not go on from it.
    """
    env: Any = collector.env
    world = env.base_env.state_dict()
    if not world:
        raise InvalidValueError(
            f"{type(env.base_env).__name__} cannot be saved: its state_dict() is empty, so that a run would go on in "
            "other simulations than it stopped in. Give it state_dict and load_state_dict, as FurnitureEnv has"
        )
    world = {k: v.to_dict() if isinstance(v, TensorDictBase) else v for k, v in world.items()}
    return {
        "world": world,
        "transforms": env.transform.state_dict(),
        "starts": state_of_sources(env),
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
    load_state_of_sources(env, state.get("starts", []))
    collector._carrier = TensorDict.from_dict(state["carried"], batch_size=batch, device=device)


PAPER_REWARDS = ("reward_env", "reward_gail", "reward_tsr")


def rollout_metrics(rollout: TensorDictBase, apart: Tensor | None = None) -> dict[str, float]:
    """What is logged of a rollout (N, T): its finished episodes, its mean phase and rewards by term.

    Args:
        rollout: of any policy.
        apart: (N, T, 1) bool, rows of episodes that began within a demonstration. These say little of what the policy
            does from a start of its own, so they are counted apart; None: there are none.

    Returns:
        episodes, and of these success_rate, completed (subtasks) and episode_length, nan where there was none; phase,
        the mean over all rows that are not apart, of episodes that go on too; with `apart` also episodes_apart and
        success_rate_apart; means of the rewards over all rows; with a "reward_tsr" also tsr_on_success, its mean over
        successes, nan where there was none.
    """
    following: TensorDictBase = rollout["next"]
    counted = torch.ones_like(following["done"]) if apart is None else ~apart
    log: dict[str, float] = _ended(following, counted)
    log["phase"] = float(following["phase"][counted].float().mean())
    if apart is not None:
        others = _ended(following, apart)
        log |= {f"{name}_apart": others[name] for name in ("episodes", "success_rate")}
    names = [str(name) for name in following.keys()]  # pyright: ignore[reportAttributeAccessIssue]
    further = sorted(name for name in names if name.startswith("reward_") and name not in PAPER_REWARDS)
    for name in (*PAPER_REWARDS, *further, "reward"):
        if name in names:
            log[name] = float(following[name].mean())
    if "reward_tsr" in log:
        paid = following["reward_tsr"][following["success"]]
        log["tsr_on_success"] = float(paid.mean()) if len(paid) else float("nan")
    return log


def _ended(following: TensorDictBase, counted: Tensor) -> dict[str, float]:
    """Of the episodes that ended: their number, and means; counted: (N, T, 1) bool."""
    done = following["done"] & counted
    names = {"success_rate": "success", "completed": "completed", "episode_length": "step_count"}
    return {"episodes": int(done.sum())} | {
        column: float(following[key][done].float().mean()) for column, key in names.items()
    }
