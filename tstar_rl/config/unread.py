"""Values that ask a recipe for what it would not do, and that its config.yaml would say all the same: refused.

Sections that several recipes share may have values that one of them does not read (training.total_steps in a chain's
fine-tuning, whose steps are those of chain.*). This imports no torch, so that such a mistake is told at once.
"""

from collections.abc import Mapping
from typing import Any

from tstar_rl.config.check import ConfigError
from tstar_rl.config.recipe_kinds import (
    FINE_TUNING,
    IN_ORDER,
    LAUNCHING,
    LEARN_FROM_PATHS,
    OF_CHAINS,
    ONE_POLICY,
    STEPS,
    WHOLE,
)
from tstar_rl.config.unread_chain import check_chain
from tstar_rl.runs.run_folder import SKILLS, UNTRAINED, is_untrained

__all__ = ["check_what_is_not_read"]

PAPERS = {"score": "terminal", "baseline": "none"}
"""Of terminal_reward: the paper's, which every scale has."""
MOMENTUM = 0.01
"""terminal_reward.momentum where it is not set: the default of `TerminalStateReward`."""
CHAINED = "chain.links takes the first skills of a chain"
SEVERAL = {
    "hand_over": "measures several at once, systems=[{}]",
    "anatomy": "shows several beside each other, systems=[{}]",
    "terminal_states": "shows several beside each other, systems=[{}]",
    "plot": "draws all that lies in results_dir",
    "report": "is of all that is published",
}
"""Recipes that read more than one system, and where to say which."""
NAMELESS = {
    "make_demonstrations": "the script makes them",
    "export": "path=... says whose episodes, without it demonstrations go out",
    "watch": "variants=[...] says which chains",
    "evaluate_shelf": "it tries the script",
    "parity": "it compares two simulators",
}
"""Recipes that read no system, and what says what they do."""
WITHOUT_PPO = ("bc", "spirl", "in_order_cloned")
"""Recipes that train policies, and have no PPO."""
WITHOUT_WORKERS = ("bc", "spirl")
"""Recipes that train policies, and collect nothing on a cluster."""


def check_what_is_not_read(values: Mapping[str, Any], name: str) -> None:
    """Refuses values that the recipe `name` would leave unread.

    Raises:
        ConfigError: for the first; it says what was got, what is valid and where the value belongs.
    """
    chains = "from_checkpoint" in values
    if values["subtask"] is not None and (chains or name in (*WHOLE, *OF_CHAINS)):
        told = "its steps say which they are of" if name in WHOLE else CHAINED
        raise ConfigError(
            f"subtask must be null, got {values['subtask']}: {name} is of the whole task; {told}"
        )
    if name in ONE_POLICY or (chains and name != "exchanged"):  # which runs two chains as they are
        _check_training(values, name, chains)
    _check_starting_others(values, name)
    _check_asked(values, name)
    _check_demonstrations(values.get("demonstrations") or {}, name)
    if name in WITHOUT_WORKERS and values["collection"]["backend"] == "ray":
        raise ConfigError(f"collection.backend must be local for {name}, got ray: it has no workers")
    _check_rewards(values, name)
    _check_normalizer(values, name)
    _check_entropy(values, name)
    if name in FINE_TUNING:
        check_chain(values, name)
    _check_paths(values, name)


def _check_training(values: Mapping[str, Any], name: str, chains: bool) -> None:
    """Refuses the name of an untrained system, and a time limit that training has elsewhere."""
    if is_untrained(values["system"]):
        raise ConfigError(
            f"the last part of system must not begin with {UNTRAINED}, which means skills chained as they are: {name} "
            f"makes others, and what evaluates them would not look at them; got system={values['system']}"
        )
    if values["env"].get("max_steps") is not None:
        limits = "training.max_steps and chain.trial_max_steps" if chains else "training.max_steps"
        limits = "spirl.max_steps" if name == "spirl" else limits
        raise ConfigError(f"env.max_steps is not read in training: the time limit there is {limits}")


def _check_starting_others(values: Mapping[str, Any], name: str) -> None:
    """Refuses names of runs where the recipes that are started name their own, and a launcher where none is."""
    if name in WHOLE and values["system"] != name:
        raise ConfigError(
            f"system must be left out, got {values['system']}: {name} starts other recipes, each of which names its "
            "own run; results_dir=... and runs_dir=... keep runs apart"
        )
    if name in WHOLE and values["skills"] != SKILLS:
        raise ConfigError(
            f"skills must be left out, got {values['skills']}: {name} starts other recipes, and says itself whose "
            "skills they chain"
        )
    if values["launch"] != "local" and name in (*STEPS, "bench", "bench_growth"):
        raise ConfigError(
            f"launch must be local for {name}, got {values['launch']}: it is for recipes that start others, "
            f"{', '.join(LAUNCHING)}; collection.backend=ray collects rollouts on a cluster"
        )


def _check_paths(values: Mapping[str, Any], name: str) -> None:
    """Refuses that the states on the way to an end are kept for what does not learn from them."""
    no_path = name in (*FINE_TUNING, "floored", "recover") and name not in LEARN_FROM_PATHS
    if no_path and values["chain"]["path_steps"]:
        raise ConfigError(
            f"chain.path_steps must be 0 for {name}, got {values['chain']['path_steps']}: "
            f"{' and '.join(LEARN_FROM_PATHS)} alone learn from paths"
        )


def _check_asked(values: Mapping[str, Any], name: str) -> None:
    """Refuses a value that says what is asked for where another one says it."""
    if name in SEVERAL and values["system"] != name:
        raise ConfigError(
            f"system must be left out, got {values['system']}: {name} {SEVERAL[name].format(values['system'])}"
        )
    if name in NAMELESS and values["system"] not in (name, "expert"):
        raise ConfigError(f"system must be left out, got {values['system']}: {NAMELESS[name]}")
    if name == "evaluate" and values["pretrained_dir"] is not None and values["pretrained"] is None:
        raise ConfigError(
            f"pretrained_dir={values['pretrained_dir']} is where pretrained=<task>/<variant> lies, which is null"
        )


def _check_demonstrations(made: Mapping[str, Any], name: str) -> None:
    if name in ("make_demonstrations", "assemble") and made.get("file") is not None:
        raise ConfigError(
            f"demonstrations.file must be null for {name}, got {made['file']}: it makes the script's, and reads none"
        )
    for key in ("observation_key", "filter_key"):
        if made.get(key) is not None and made.get("file") is None:
            raise ConfigError(
                f"demonstrations.{key} is of a file of your own, and demonstrations.file is null; got {made[key]}"
            )


def _check_rewards(values: Mapping[str, Any], name: str) -> None:
    weights, reward = values["reward"].get("weights") or {}, values["terminal_reward"]
    if not isinstance(weights, Mapping):
        raise ConfigError(f"reward.weights must be null or a section, {{<term>: <weight>}}; got {weights!r}")
    if name == "ppo" and weights.get("gail"):
        raise ConfigError(
            f"reward.weights.gail must be 0 for ppo, which makes no such reward; gail_ppo does; got {weights['gail']}"
        )
    if name == "spirl" and values["reward"].get("weights") is None:
        raise ConfigError("reward.weights must be given for spirl, which makes no reward but env; got null")
    further = {term: weight for term, weight in weights.items() if weight and term != "env"}
    if name == "spirl" and further:
        said = ", ".join(f"reward.weights.{term}={weight}" for term, weight in further.items())
        raise ConfigError(f"spirl makes no reward but env: the other weights must be 0, got {said}")
    if name == "proximity" and weights.get("tsr"):
        raise ConfigError(
            "reward.weights.tsr must be 0 for proximity, whose signal is paid by reward.weights.proximity; "
            f"got {weights['tsr']}"
        )
    if values.get("bonus") is not None and not weights.get("tsr"):
        raise ConfigError(
            f"bonus is paid by reward.weights.tsr, which must not be 0 then; got bonus={values['bonus']}"
        )
    given = {key: reward[key] for key, papers in PAPERS.items() if reward.get(key, papers) != papers}
    if reward.get("baseline", PAPERS["baseline"]) == "none" and reward.get("momentum", MOMENTUM) != MOMENTUM:
        given["momentum"] = reward["momentum"]
    if name in ("tstar", "scar_like", "feasibility", "hand_over_value") and "momentum" in given:
        raise ConfigError(
            "terminal_reward.momentum is of terminal_reward.baseline=running_mean, and that is none; got "
            f"{given['momentum']}"
        )
    if name in ("policy_sequencing", "proximity", *IN_ORDER) and given:
        said = ", ".join(f"terminal_reward.{key}={value}" for key, value in given.items())
        raise ConfigError(
            f"{name} does not read terminal_reward, got {said}; tstar, scar_like, feasibility and hand_over_value do"
        )


def _check_normalizer(values: Mapping[str, Any], name: str) -> None:
    """Refuses a normaliser that runs on where it is fitted once."""
    if not values["normalizer"]["running"]:
        return
    told = f"normalizer.running must be false for {name}, got true"
    if name in IN_ORDER:
        raise ConfigError(
            f"{told}: a skill's normaliser is fitted to the demonstrations that it is cloned from, and stays"
        )
    if name == "spirl":
        raise ConfigError(f"{told}: its normaliser is fitted to the demonstrations, and stays")
    if name in ("ppo", "gail", "gail_ppo") and values["warm_start"]:
        raise ConfigError(
            f"{told} with warm_start=true: the first rollouts would change the inputs of the clone that it begins "
            "with; set one of the two to false"
        )


def _check_entropy(values: Mapping[str, Any], name: str) -> None:
    """Refuses a bonus for an entropy that nothing changes."""
    if (
        name not in (*ONE_POLICY, *FINE_TUNING)
        or name in WITHOUT_PPO
        or values["networks"].get("std") != "fixed"
    ):
        return
    key, asked = "ppo", values["ppo"]
    if name in FINE_TUNING and "entropy_coeff" in values["chain"]["ppo"]:
        key, asked = "chain.ppo", values["chain"]["ppo"]
    if asked.get("entropy_coeff"):
        raise ConfigError(
            "networks.std=fixed is a deviation that does not learn, so no entropy can rise; got "
            f"{key}.entropy_coeff={asked['entropy_coeff']}: set it to 0, or networks.std=state"
        )
