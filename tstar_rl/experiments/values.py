"""A declared experiment from the values of `configs/experiment/<name>.yaml`, and what is refused in them."""

from collections.abc import Mapping
from typing import Any

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.check import check
from tstar_rl.config.limits import MOST
from tstar_rl.config.overrides import key_of
from tstar_rl.config.recipe_kinds import ONE_POLICY
from tstar_rl.config.values import task_section
from tstar_rl.experiments.declared import Arm, DeclaredExperiment
from tstar_rl.runs.run_folder import RECIPES, UNTRAINED, check_says_if_trained

__all__ = ["parse_experiment"]

OF_CHAINS = ("bonus_of", "skills", "skill_overrides", "later_skill_overrides", "skills_of")
"""What an arm of one policy for the whole task cannot say."""


def parse_experiment(values: Mapping[str, Any]) -> DeclaredExperiment:
    """An experiment from plain values.

    Raises:
        InvalidValueError: for a field that is not known or missing or of another type, a list that is empty or names
            something twice, a task or a recipe that is not there, seeds of a task that is not there, two arms of one
            name, an arm that trains nothing under a name of one that does or the other way round, an arm whose bonus is
            that of an arm that does not exist or has other seeds, an arm with the skills of one that has none of its
            own or is of another recipe of skills, an arm that gives its skills' world as a section, an arm of one
            policy for the whole task that says something of skills.
    """
    check(
        values,
        DeclaredExperiment,
        "experiment",
        {"arms": tuple[dict[str, Any], ...], "seeds_by_task": dict[str, Any]},
    )
    if values.get("demonstrations_dir") is not None:
        raise InvalidValueError(
            "experiment.demonstrations_dir is no value of the file: demonstrations lie in a folder of the experiment's "
            "own; the command line may name another (demonstrations_dir=...)"
        )
    plain, by_task = _with_tuples(values), values.get("seeds_by_task", {})
    if not values["arms"]:
        raise InvalidValueError("experiment.arms must name at least one, got none")
    plain["arms"] = tuple(_parse_arm(one, values.get("commit")) for one in values["arms"])
    plain["seeds_by_task"] = _with_tuples(by_task)
    _check_once("experiment.tasks", plain["tasks"])
    for task in plain["tasks"]:
        task_section(task)
    unknown = sorted(set(plain["seeds_by_task"]) - set(plain["tasks"]))
    if unknown:
        raise InvalidValueError(
            f"experiment.seeds_by_task names {', '.join(unknown)}; tasks are {', '.join(plain['tasks'])}"
        )
    for where, seeds in (("seeds", plain["seeds"]), *plain["seeds_by_task"].items()):
        _check_seeds("experiment.seeds" if where == "seeds" else f"experiment.seeds_by_task.{where}", seeds)
    experiment = DeclaredExperiment(**plain)
    _check_arms(experiment)
    return experiment


def _parse_arm(values: Mapping[str, Any], commit: str | None) -> Arm:
    check(values, Arm, "an arm of the experiment")
    arm = Arm(**_with_tuples(values))
    check_says_if_trained("experiment.arms", arm.name, arm.recipe)
    if arm.recipe == UNTRAINED and (given := [name for name in ("overrides", "bonus_of") if name in values]):
        raise InvalidValueError(
            f"experiment.arms: {arm.name} trains nothing, so that {' and '.join(given)} would do nothing; what its "
            "skills are trained with goes to skill_overrides, what every arm has to experiment.overrides"
        )
    for value in (*arm.skill_overrides, *arm.later_skill_overrides):
        if key_of(value) == "env":
            raise InvalidValueError(
                f"experiment.arms: {arm.name} must name each setting of its skills' world by itself, as in "
                f"env.arm_noise=0.2; got {value}"
            )
    if arm.whole:
        _check_whole(arm, [name for name in OF_CHAINS if name in values])
    if arm.seeds is not None:
        _check_seeds(f"experiment.arms: seeds of {arm.name}", arm.seeds)
    for name in (arm.recipe, arm.skills):
        pinned = arm.commit or commit  # whose recipes are others
        if not pinned and name != UNTRAINED and not (RECIPES / f"{name}.py").is_file():
            raise InvalidValueError(
                f"experiment.arms: {arm.name} has the recipe {name}; there is no recipes/{name}.py"
            )
    return arm


def _check_whole(arm: Arm, of_chains: list[str]) -> None:
    one = f"experiment.arms: {arm.name} is one policy for the whole task, which"
    if of_chains:
        raise InvalidValueError(f"{one} has no {', '.join(of_chains)}")
    if arm.recipe not in ONE_POLICY:
        raise InvalidValueError(
            f"{one} recipe {arm.recipe} does not train; these do: {', '.join(ONE_POLICY)}"
        )


def _check_seeds(where: str, seeds: Any) -> None:
    most = MOST["seed"]
    whole = isinstance(seeds, tuple) and all(type(seed) is int and 0 <= seed <= most for seed in seeds)
    if not whole:
        raise InvalidValueError(f"{where} must be a list of whole numbers from 0 to {most}, got {seeds!r}")
    _check_once(where, seeds)


def _check_once(where: str, named: tuple[Any, ...]) -> None:
    if not named or len(set(named)) < len(named):
        got = ", ".join(map(str, named)) or "none"
        raise InvalidValueError(f"{where} must name at least one, and each once; got {got}")


def _check_arms(experiment: DeclaredExperiment) -> None:
    """Raises InvalidValueError for two arms of one name, or one whose skills or whose bonus some seed cannot know."""
    for arm in experiment.arms:
        if unknown := sorted(set(arm.seeds or ()) - set(experiment.every_seed)):
            raise InvalidValueError(
                f"experiment.arms: {arm.name} has seeds {', '.join(map(str, unknown))}, which no task has; there are "
                f"{', '.join(map(str, experiment.every_seed))}"
            )
    names = [arm.name for arm in experiment.arms]
    if len(set(names)) < len(names):
        raise InvalidValueError(f"experiment.arms has two arms of one name: {', '.join(names)}")
    owners = {arm.name: arm for arm in experiment.arms if arm.has_own_skills}
    for arm in experiment.arms:
        if arm.skills_of in owners and arm.skills != owners[arm.skills_of].skills:
            raise InvalidValueError(
                f"experiment.arms: {arm.name} has the skills of {arm.skills_of}, which are trained by "
                f"{owners[arm.skills_of].skills}; it must have skills: {owners[arm.skills_of].skills}, got {arm.skills}"
            )
        if arm.skills_of is not None and (arm.has_own_skills or arm.skills_of not in owners):
            raise InvalidValueError(
                f"experiment.arms: {arm.name} has the skills of {arm.skills_of}; it may have no overrides of skills "
                f"then, and arms with skills of their own are {', '.join(owners) or 'none'}"
            )
    paid = [arm for arm in experiment.arms if arm.bonus_of is not None]
    unpaid = [arm.name for arm in experiment.arms if arm.recipe == UNTRAINED or arm.whole]
    for arm in paid:
        if arm.bonus_of in unpaid:
            raise InvalidValueError(
                f"experiment.arms: {arm.name} has the bonus of {arm.bonus_of}, which trains no chain and pays none"
            )
        if arm.bonus_of in [other.name for other in paid]:
            raise InvalidValueError(
                f"experiment.arms: {arm.name} has the bonus of {arm.bonus_of}, which is paid another's itself"
            )
        for seed in experiment.every_seed if arm.seeds is None else arm.seeds:
            there = [each.name for each in experiment.arms_of(seed)]
            if arm.bonus_of not in there:
                raise InvalidValueError(
                    f"experiment.arms: {arm.name} has the bonus of {arm.bonus_of}; seed {seed} has {', '.join(there)}"
                )


def _with_tuples(values: Mapping[str, Any]) -> dict[str, Any]:
    """Each list as a tuple: what is declared does not change."""
    return {name: tuple(each) if isinstance(each, (list, tuple)) else each for name, each in values.items()}
