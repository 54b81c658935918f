"""Values of a chain's fine-tuning that it would leave unread: refused, as `config/unread.py` does for every recipe."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from tstar_rl.chaining.warm_up import check_that_policies_learn
from tstar_rl.config.check import ConfigError
from tstar_rl.config.ranges import turn_shape
from tstar_rl.config.recipe_kinds import LEARN_FROM_KEPT

__all__ = ["check_chain"]

LOGGED = 2
"""chain.logged_skill of every scale, whatever the furniture: where a chain has fewer skills, it logs no states."""


def check_chain(values: Mapping[str, Any], name: str) -> None:
    """Refuses what the fine-tuning recipe `name` would leave unread, of chain.* and of its starts.

    Raises:
        ConfigError: for the first; it says what was got, what is valid and where the value belongs.
    """
    _check_turns(values, name)
    _check_signal(values, name)
    _check_starts(values, name)
    if values.get("demonstrated_ends"):
        _check_demonstrated_ends(values)


def _check_turns(values: Mapping[str, Any], name: str) -> None:
    chain = values["chain"]
    links = chain["links"] or values["task"]["subtasks"]
    if chain["logged_states"] and chain["logged_skill"] >= max(links, LOGGED + 1):
        raise ConfigError(
            f"chain.logged_skill must be in 0..{links - 1} in a chain of {links} skills, got {chain['logged_skill']}"
        )
    if chain["gate"] and chain["trial_every"] != 1:
        raise ConfigError(
            f"chain.trial_every must be 1 with chain.gate=true, which judges every turn by a trial; got "
            f"{chain['trial_every']}: set chain.gate=false as well"
        )
    if name != "in_order_cloned":  # which learns from no rollout
        rollouts, _ = turn_shape(values)
        warm_up = {**values["ppo"], **chain["ppo"]}.get("critic_warmup", 0)
        if not isinstance(warm_up, int):
            raise ConfigError(f"critic_warmup must be a whole number, got {warm_up!r}")
        check_that_policies_learn(warm_up, rollouts, chain["rounds"], chain["carry_over"], chain["order"])


def _check_signal(values: Mapping[str, Any], name: str) -> None:
    """Refuses a signal that is paid and has learned nothing."""
    chain = values["chain"]
    own_only = chain["d_omega_of"] == "own" and chain["rounds"] == 1 and chain["order"] == "forward"
    if name == "tstar" and own_only:
        raise ConfigError(
            "chain.rounds must be at least 2 for tstar with chain.d_omega_of=own, got 1: the d_omega that pays a skill "
            "learns in the next skill's turn, and would pay nothing before that; or set chain.d_omega_of=next"
        )
    if name == "hand_over_value" and _are_clones(values) and chain["order"] != "backward":
        raise ConfigError(
            f"chain.order must be backward for hand_over_value with clones, got {chain['order']}: a clone's critic has "
            "learned nothing before its own turn, and would pay the skill before; or chain other skills"
        )


def _check_starts(values: Mapping[str, Any], name: str) -> None:
    chain, starts = values["chain"], values["chain"]["starts"]
    no_chained_starts = not any(share for source, share in starts.items() if source != "environment")
    keeps = name in LEARN_FROM_KEPT or values.get("demonstrated_ends")
    if name == "in_order_cloned" and not values["demonstrated_ends"]:
        raise ConfigError(
            "demonstrated_ends must be above 0 for in_order_cloned, which learns from nothing else, got 0"
        )
    if keeps and chain["kept_states"] == "chained" and no_chained_starts:
        raise ConfigError(
            f"chain.kept_states must be all for {name} where chain.starts has no chained starts, got chained: what "
            "it learns from would never grow"
        )
    if values.get("hard_starts") and not starts.get("buffer"):
        raise ConfigError(
            "hard_starts is a share of the starts from the buffer, and chain.starts has none; got "
            f"{values['hard_starts']}"
        )
    if values.get("hard_starts") and values["collection"]["backend"] == "ray":
        raise ConfigError(
            "hard_starts needs collection.backend=local, got ray: workers of a cluster draw starts from copies of a set"
        )


def _check_demonstrated_ends(values: Mapping[str, Any]) -> None:
    """Refuses what does not go with skills that are cloned anew over the ends of those before."""
    chain = values["chain"]
    if not _are_clones(values):
        raise ConfigError(
            f"skills must be clones, bc or bc_<...>, got {values['skills']}: what demonstrated_ends makes anew is "
            "cloned over a skill, and the normaliser of its networks is fitted again; or set demonstrated_ends=0"
        )
    again = {"gate": chain["gate"], "rounds": chain["rounds"] > 1, "order": chain["order"] != "forward"}
    if any(again.values()):
        said = ", ".join(f"chain.{key}={chain[key]}" for key in again if again[key])
        raise ConfigError(
            "what demonstrated_ends makes anew is cloned in the one turn of a skill, and stays: chain.gate must be "
            f"false, chain.rounds 1 and chain.order forward, got {said}; or set demonstrated_ends=0"
        )


def _are_clones(values: Mapping[str, Any]) -> bool:
    return Path(values["skills"]).name.partition("_")[0] == "bc"  # an experiment's own skills are <arm>/bc
