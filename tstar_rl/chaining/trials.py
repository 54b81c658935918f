"""Trials: deterministic episodes that tell how good skills are, and what they hand over."""

from collections.abc import Callable, Sequence

from tensordict import TensorDictBase
from torchrl.envs import ExplorationType, TransformedEnv, set_exploration_type

from tstar_rl.chaining.chain import ChainPolicy
from tstar_rl.chaining.skill import Skill
from tstar_rl.rollouts.episodes import run_episodes

__all__ = ["chain_progress", "hand_over", "seed_sets", "try_out"]


def chain_progress(skills: Sequence[Skill], env: TransformedEnv) -> float:
    """Mean share of a chain's subtasks that are done in one deterministic episode of every simulation; closes `env`."""
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        last = run_episodes(env, ChainPolicy(skills))
    env.close()
    return float(last["next", "completed"].clamp(max=len(skills)).double().mean()) / len(skills)


def try_out(skill: Skill, env: TransformedEnv) -> tuple[float, TensorDictBase]:
    """One deterministic episode of every simulation: the share that succeeds, and the last steps; closes `env`."""
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        last = run_episodes(env, skill.policy)
    env.close()
    return float(last["next", "success"].double().mean()), last


def hand_over(skill: Skill, last: TensorDictBase) -> None:
    """The states that a trial reached become the termination set; the starts it succeeded from join the initiation set.

    What a rejected policy reached while it trained leaves the termination set here: the next skill would never start
    there. The starts that it succeeded from stay in the initiation set, though the kept policy may fail from them.
    """
    skill.termination_set.clear()
    skill.termination_set.extend_from(last)
    skill.initiation_set.extend_from(last)


def seed_sets(skills: Sequence[Skill], make_trial: Callable[[int], TransformedEnv]) -> None:
    """Tries the skills in order, each from where the one before ends, so that every set has members."""
    for index, skill in enumerate(skills):
        _, last = try_out(skill, make_trial(index))
        hand_over(skill, last)
