"""A declared experiment from the values of `configs/experiment/<name>.yaml`, and what is refused in them."""

from collections.abc import Iterable, Mapping
from typing import Any

from tstar_rl.checks import InvalidValueError
from tstar_rl.launch.experiment import Arm, DeclaredExperiment
from tstar_rl.runs.run_folder import UNTRAINED

__all__ = ["parse_experiment"]


def parse_experiment(values: Mapping[str, Any]) -> DeclaredExperiment:
    """An experiment from plain values.

    Raises:
        InvalidValueError: for a field that is not known or missing, seeds of a task that is not there, two arms of one
            name, an arm that trains nothing under a name of one that does, an arm whose bonus is that of an arm that
            does not exist or has other seeds, an arm with the skills of one that has none of its own.
    """
    fields = DeclaredExperiment.__dataclass_fields__
    _check_names("experiment", values, fields, ("name", "page", "scale", "tasks", "seeds", "arms"))
    plain = _with_tuples(values)
    plain["arms"] = tuple(_parse_arm(one) for one in values["arms"])
    plain["seeds_by_task"] = _with_tuples(values.get("seeds_by_task", {}))
    unknown = sorted(set(plain["seeds_by_task"]) - set(plain["tasks"]))
    if unknown:
        raise InvalidValueError(
            f"experiment.seeds_by_task names {', '.join(unknown)}; tasks are {', '.join(plain['tasks'])}"
        )
    experiment = DeclaredExperiment(**plain)
    _check_arms(experiment)
    return experiment


def _parse_arm(values: Mapping[str, Any]) -> Arm:
    _check_names("an arm of the experiment", values, Arm.__dataclass_fields__, ("name", "recipe"))
    arm = Arm(**_with_tuples(values))
    if arm.recipe == UNTRAINED and not arm.name.startswith(UNTRAINED):
        raise InvalidValueError(f"experiment.arms: {arm.name} trains nothing, so call it {UNTRAINED}...")
    return arm


def _check_arms(experiment: DeclaredExperiment) -> None:
    """Raises InvalidValueError for two arms of one name, or one whose skills or whose bonus some seed cannot know."""
    names = [arm.name for arm in experiment.arms]
    if len(set(names)) < len(names):
        raise InvalidValueError(f"experiment.arms has two arms of one name: {', '.join(names)}")
    owners = [arm.name for arm in experiment.arms if arm.has_own_skills]
    for arm in experiment.arms:
        if arm.skills_of is not None and (arm.has_own_skills or arm.skills_of not in owners):
            raise InvalidValueError(
                f"experiment.arms: {arm.name} has the skills of {arm.skills_of}; it may have no overrides of skills "
                f"then, and arms with skills of their own are {', '.join(owners) or 'none'}"
            )
    paid = [arm for arm in experiment.arms if arm.bonus_of is not None]
    for arm in paid:
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


def _check_names(what: str, values: Mapping[str, Any], known: Iterable[str], needed: tuple[str, ...]) -> None:
    unknown = [str(name) for name in values if name not in known]
    lacks = [name for name in needed if name not in values]
    if unknown or lacks:
        wrong = f"has no {', '.join(unknown)}" if unknown else f"lacks {', '.join(lacks)}"
        raise InvalidValueError(f"{what} {wrong}; it has {', '.join(known)}")


def _with_tuples(values: Mapping[str, Any]) -> dict[str, Any]:
    """Each list as a tuple: what is declared does not change."""
    return {name: tuple(each) if isinstance(each, (list, tuple)) else each for name, each in values.items()}
