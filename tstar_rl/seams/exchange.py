"""Who mended a seam: the skill that hands over, or the one that takes over.

Fine-tuning changes both skills at a seam. Here each of them in turn is exchanged for what it was before. Four successes
of the second skill come out: where the first hands over as before or as after, and the second takes over as before or
as after. What T-STAR means to change is the first.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

from tensordict import TensorDictBase
from torchrl.envs import ExplorationType, TransformedEnv, set_exploration_type

from tstar_rl.chaining.skill import Skill
from tstar_rl.checks import InvalidValueError
from tstar_rl.rollouts.episodes import run_episodes
from tstar_rl.rollouts.state_sets import TerminationSet
from tstar_rl.seams.influence import Repeated

__all__ = ["VERSIONS", "Exchange", "exchange_skills", "run_from"]

VERSIONS = ("before", "after")

MakeEnv = Callable[[int, int, TerminationSet | None], TransformedEnv]
"""Of a subtask, a number of simulations, and the set that all of them begin in; None: the subtask's own starts."""


class Exchange(NamedTuple):
    """One of the four at a seam."""

    subtask: int
    """Of the second skill, 1 to K - 1."""
    handed_by: str
    """Which first skill, of `VERSIONS`."""
    taken_by: str
    """Which second skill."""
    episodes: int
    """Of the first skill, all from the same starts."""
    handed: int
    """In how many of them it succeeded."""
    taken: int
    """In how many of these the second one then did."""


def run_from(
    make_env: MakeEnv, index: int, skill: Skill, starts: TensorDictBase | None, number: int
) -> TensorDictBase:
    """The states in which a skill succeeds, deterministic actions: "observation" and "snapshot", in order.

    Args:
        make_env: see `MakeEnv`.
        index: of its subtask.
        skill: the one to run.
        starts: states with "snapshot", one episode from each; None: `number` episodes from its own starts.
        number: of episodes without `starts`.
    """
    if starts is not None and not starts.batch_size[0]:
        return starts
    number = number if starts is None else starts.batch_size[0]
    env = make_env(index, number, None if starts is None else Repeated(starts))
    with set_exploration_type(ExplorationType.DETERMINISTIC):
        last = run_episodes(env, skill.policy)
    env.close()
    won = last["next", "success"].squeeze(-1)
    return last.get("next")[won].select("observation", "snapshot")


def exchange_skills(
    before: Sequence[Skill], after: Sequence[Skill], make_env: MakeEnv, episodes: int
) -> list[Exchange]:
    """Runs both skills of every seam as they were before and as they are after, in all four ways.

    Args:
        before, after: the same chain before and after fine-tuning, or two chains of the same skills, in order.
        make_env: see `MakeEnv`.
        episodes: of the first skill. Every later one begins where the chain *after* fine-tuning arrives, for all four
            ways, so that nothing else differs between them.

    Returns:
        Four for each seam, in order. A seam that nothing reaches has `episodes` 0.

    Raises:
        InvalidValueError: if one chain has more skills than the other.
    """
    if len(before) != len(after):
        raise InvalidValueError(
            f"chains whose skills are exchanged must have the same skills, got {len(before)} and {len(after)}: "
            "chain.links takes the first skills of both"
        )
    found: list[Exchange] = []
    starts: TensorDictBase | None = None
    for index in range(len(after) - 1):
        began = episodes if starts is None else starts.batch_size[0]
        first, second = (before[index], after[index]), (before[index + 1], after[index + 1])
        ends = [run_from(make_env, index, skill, starts, episodes) for skill in first]
        for handed_by, handed in zip(VERSIONS, ends, strict=True):
            for taken_by, skill in zip(VERSIONS, second, strict=True):
                taken = run_from(make_env, index + 1, skill, handed, 0).batch_size[0]
                found.append(Exchange(index + 1, handed_by, taken_by, began, handed.batch_size[0], taken))
        starts = ends[1]
    return found
