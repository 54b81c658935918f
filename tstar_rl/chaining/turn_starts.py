"""What a turn can do about its starts: clone the expert where the skill before ends, or draw hard ones more often."""

from collections.abc import Callable

import torch
from torch import Tensor

from tstar_rl.chaining.turn_updates import TurnUpdates
from tstar_rl.checks import InvalidValueError
from tstar_rl.rollouts.ray_collection import RayCollection
from tstar_rl.signal_equations import start_weights
from tstar_rl.updates import BehaviourCloningSettings, behaviour_cloning

__all__ = ["begin_where_it_fails", "clone_from_ends"]


def clone_from_ends(turn: TurnUpdates, share: float, cloning: BehaviourCloningSettings) -> None:
    """Clones the expert again, a share of whose demonstrations begins where the skill before ends.

    They are made now, and stand in the place of as many of the skill's own; the normaliser is fitted to both. Where the
    skill has ended so far is forgotten: its old clone was there, and the next skill is to begin where this one ends.
    Nothing is cloned before the first skill, with a share of 0, or while the skill before has not succeeded.

    Args:
        turn: before its first rollout.
        share: in [0, 1], of the episodes.
        cloning: how.

    Raises:
        InvalidValueError: for another share. For one that is not 0: if a gate judges the turn, if a skill can have more
            turns than one, or if its normaliser runs on, which would change what is cloned.
        DemonstrationError: if the expert fails too often from there.

    Source: Ross et al. 2011, DAgger: demonstrations from the states that the learner gets into.
    """
    if not 0.0 <= share <= 1.0:
        raise InvalidValueError(f"the share of demonstrations from ends must be in [0, 1], got {share}")
    if not share:
        return
    _check_that_it_is_the_only_turn(turn)
    number = max(round(share * len(turn.expert)), 1)
    if turn.previous is None:
        return
    if not len(turn.previous.termination_set):
        print(
            f"skill {turn.index}: the skill before has not succeeded, so no demonstration begins where it ends, and "
            "its clone stays as it is"
        )
        return
    before, skill = turn.previous.termination_set, turn.skill
    made = turn.chain.workshop.demonstrations(turn.index, before, number, turn.seed)
    turn.expert = turn.expert.first(len(turn.expert) - number).and_also(made)
    seen = turn.expert.observations
    skill.normalizer.fit(seen, turn.settings.normalizer_floor)
    behaviour_cloning(skill.policy, seen, turn.expert.actions, cloning, turn.seed)
    skill.termination_set.clear()
    torch.manual_seed(turn.seed)


def _check_that_it_is_the_only_turn(turn: TurnUpdates) -> None:
    """Raises InvalidValueError where a clone could be put back, or would go over what a turn has learned."""
    settings = turn.chain.settings
    if turn.settings.running_normalizer:
        raise InvalidValueError(
            "a normaliser that runs on changes a clone that was fitted through it: set normalizer.running=false"
        )
    if turn.chain.gate.settings.rejects:
        raise InvalidValueError("a gate does not put back what is cloned in a turn: set chain.gate=false")
    if settings.rounds > 1 or settings.order != "forward":
        raise InvalidValueError(
            "a second turn of a skill would clone over what its first has learned, and in another order demonstrations "
            "would begin where the skill before ends no longer: set chain.rounds=1 and chain.order=forward, got "
            f"chain.rounds={settings.rounds} and chain.order={settings.order}"
        )


def begin_where_it_fails(turn: TurnUpdates, expected: Callable[[Tensor], Tensor], share: float) -> None:
    """Draws a share of the chained starts by how little is expected of the skill there, from now on in this turn.

    Episodes that run already, each simulation's first among them, began before.

    Args:
        turn: of the skill.
        expected: observations (n, O) -> (n, 1) in [0, 1], how likely the skill is to succeed from there.
        share: in [0, 1]; the other starts are drawn uniformly. A Gaussian keeps its mean and its deviations.

    Raises:
        InvalidValueError: for another share, or if workers of a cluster collect; they draw starts from copies of the
            set.
    """
    if not 0.0 <= share <= 1.0:
        raise InvalidValueError(f"the share of starts by expected failure must be in [0, 1], got {share}")
    if isinstance(turn.collection, RayCollection):
        raise InvalidValueError("starts by expected failure need collection.backend=local, got ray")
    if turn.previous is None or not len(turn.previous.termination_set):
        return
    states = turn.previous.termination_set
    with torch.no_grad():
        states.weigh(start_weights(expected(states.observations()).squeeze(-1), share))
