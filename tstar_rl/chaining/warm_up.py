"""Whether a chain's turns are long enough for a policy to learn. Loads no torch, so that a config is told at once."""

from tstar_rl.checks import InvalidValueError

__all__ = ["check_that_policies_learn"]


def check_that_policies_learn(
    critic_warmup: int, rollouts: int, rounds: int, carry_over: bool, order: str
) -> None:
    """Refuses turns in which a skill's critic alone would learn.

    Args:
        critic_warmup: the rollouts from which the critic alone learns, at the beginning of an update.
        rollouts: of a turn.
        rounds, carry_over, order: see `ChainSettings`.

    Raises:
        InvalidValueError: if one update sees no more rollouts than that. It lives for one turn without carry_over or
            with order=costliest, else for all rounds.
    """
    once = not carry_over or order == "costliest"  # an update begins anew, or may have the only turn
    turns = 1 if once else rounds
    if turns * rollouts <= critic_warmup:
        raise InvalidValueError(
            f"no policy would be trained: {turns} turns of a skill have {turns * rollouts} rollouts, and its critic "
            f"alone learns from the first {critic_warmup}. Lower chain.ppo.critic_warmup, or raise chain.steps_per_turn"
        )
