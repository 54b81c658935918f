"""A declared experiment: its arms, and the steps that each of its seeds takes.

An arm is a way of chaining, of the same skills unless it says so, or one policy for the whole task. The arms of one
seed share demonstrations, skills, budget and trials. They are evaluated on the same starts.
"""

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tstar_rl.checks import InvalidValueError, did_you_mean
from tstar_rl.config.overrides import quoted, section_of
from tstar_rl.launch.bonus import BONUS
from tstar_rl.launch.side_by_side import Step
from tstar_rl.runs.run_folder import SKILLS, UNTRAINED, Place, run_path

__all__ = ["Arm", "DeclaredExperiment"]


@dataclass(frozen=True)
class Arm:
    """One way of chaining, or one policy for the whole task."""

    name: str
    recipe: str
    """`no_finetuning` has nothing to train."""
    overrides: tuple[str, ...] = ()
    """Hydra overrides of its training."""
    bonus_of: str | None = None
    """Pays as `bonus` what another arm of the same seed was paid for a success, on average."""
    seeds: tuple[int, ...] | None = None
    """None: those of the experiment."""
    skills: str = SKILLS
    """The recipe of the skills that it starts from. With `bc` its turns are all the training that they have."""
    skill_overrides: tuple[str, ...] = ()
    """Hydra overrides of its skills. These are then its own, as are the demonstrations that they are made from."""
    later_skill_overrides: tuple[str, ...] = ()
    """The same of its skills but the first, which begins where the task does."""
    skills_of: str | None = None
    """Starts from another arm's own skills, and learns from their demonstrations."""
    commit: str | None = None
    """Whose code runs it; None: that of the experiment."""
    whole: bool = False
    """One policy learns the whole task: there are no skills, and nothing is chained."""

    @property
    def owner(self) -> str | None:
        """The arm whose own skills and demonstrations it has; None: those that arms share."""
        return self.skills_of or (self.name if self.has_own_skills else None)

    @property
    def has_own_skills(self) -> bool:
        """Whether skills are trained for it."""
        return bool(self.skill_overrides or self.later_skill_overrides)

    @property
    def skills_from(self) -> str:
        """The system of the skills that it starts from."""
        return f"{self.owner}/{self.skills}" if self.owner else self.skills

    @property
    def skill_settings(self) -> tuple[str, ...]:
        """The settings of the world in which its own skills, or some of them, are trained otherwise."""
        given = _of_world((*self.skill_overrides, *self.later_skill_overrides))
        return tuple(dict.fromkeys(value.partition("=")[0].partition(".")[2] for value in given))

    def own_skills(self, subtasks: int, demonstrations: str) -> list[Step]:
        """Demonstrations, training and evaluation of skills of its own.

        Args:
            subtasks: of the task.
            demonstrations: the folder of the demonstrations that arms share; its own lie below it.

        Returns:
            Steps less the values that all steps of a seed share; so in the other methods.
        """
        steps: list[Step] = []
        system = f"system={self.name}/{self.skills}"
        for index in range(subtasks):
            overrides = (*self.skill_overrides, *(self.later_skill_overrides if index else ()))
            made = (f"subtask={index}", _lie_in(demonstrations, self.name), *overrides)
            steps += [("make_demonstrations", *made), (self.skills, system, *made)]
            steps += [("evaluate", system, *made, "video=false")]
        return steps

    def steps(self, subtasks: int, demonstrations: str, may_differ: Sequence[str] = ()) -> list[Step]:
        """Its training and evaluation, once the skills that it starts from are there.

        It is evaluated in the world that it is trained in.

        Args:
            subtasks: see `own_skills`.
            demonstrations: see `own_skills`.
            may_differ: the settings of the world in which these skills were trained otherwise.
        """
        world = _of_world(self.overrides)
        if self.whole:
            system = f"system={self.name}"
            return [(self.recipe, system, *self.overrides), ("evaluate", system, *world, "video=false")]
        values = (f"system={self.name}", f"skills={self.skills_from}")
        bonus = () if self.bonus_of is None else (f"{BONUS}{self.bonus_of}",)
        shown = (_lie_in(demonstrations, self.owner),) if self.owner else ()
        steps: list[Step] = []
        if self.skills != SKILLS and not self.owner:
            steps += [(self.skills, f"subtask={index}") for index in range(subtasks)]
        if self.recipe != UNTRAINED:
            steps.append((self.recipe, *values, *shown, *self.overrides, *bonus))
        elif may_differ:
            world = (f"demonstrations.may_differ=[{','.join(may_differ)}]",)
        return [*steps, ("evaluate", *values, *world, "video=false")]


def _lie_in(demonstrations: str, owner: str) -> str:
    """The override that names the folder of an arm's own demonstrations."""
    return f"demonstrations_dir={quoted(f'{demonstrations}/{owner}')}"


def _of_world(overrides: Iterable[str]) -> tuple[str, ...]:
    """Those of them that are settings of the world."""
    return tuple(value for value in overrides if section_of(value) == "env")


@dataclass(frozen=True)
class DeclaredExperiment:
    """What is run, before it is run; `page` says why and how it will be read."""

    name: str
    page: str
    scale: str
    tasks: tuple[str, ...]
    seeds: tuple[int, ...]
    arms: tuple[Arm, ...]
    overrides: tuple[str, ...] = ()
    """Hydra overrides of every step."""
    commit: str | None = None
    """Whose code runs it; None: that of the checkout in which it is started."""
    seeds_by_task: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    """Of a task that has others than `seeds`. An arm with seeds of its own has those of them that its task has."""
    demonstrations_dir: str | None = None
    """Of the demonstrations that arms share, those of an arm's own below it; None: that of `shared`."""

    @property
    def every_seed(self) -> tuple[int, ...]:
        """The seeds that any task has."""
        seeds = (self.seeds_by_task.get(task, self.seeds) for task in self.tasks)
        return tuple(dict.fromkeys(seed for of_task in seeds for seed in of_task))

    def lanes(self, seeds: Iterable[int] = (), tasks: Iterable[str] = ()) -> list[tuple[str, int]]:
        """Task and seed of everything that is run, seed by seed.

        Args:
            seeds: only these; none: all. One that is not declared for any task is taken as it is, for tuning.
            tasks: only these; none: all.

        Raises:
            InvalidValueError: if none of the tasks has one of the seeds, a task is not declared, or one is named twice.
        """
        seeds, tasks = tuple(seeds) or self.every_seed, tuple(tasks) or self.tasks
        known = set(self.every_seed)
        if unknown := [task for task in tasks if task not in self.tasks]:
            raise InvalidValueError(
                f"experiment {self.name} has tasks {', '.join(self.tasks)}; got {', '.join(unknown)}"
                f"{did_you_mean(unknown[0], self.tasks)}"
            )
        for name, given in (("seeds", seeds), ("tasks", tasks)):
            if len(set(given)) < len(given):
                raise InvalidValueError(f"{name} must name each once, got {', '.join(map(str, given))}")
        found = [
            (task, seed)
            for seed in seeds
            for task in tasks
            if seed not in known or seed in self.seeds_by_task.get(task, self.seeds)
        ]
        if not found:
            raise InvalidValueError(
                f"experiment {self.name} has none of seeds {', '.join(map(str, seeds))} on {', '.join(tasks)}"
            )
        return found

    def shared(self, task: str, seed: int) -> list[str]:
        """The values of every step of one seed on one task; its files lie in folders of the experiment's own."""
        places = [f"{place}_dir={place}/{self.name}" for place in ("results", "runs", "demonstrations")]
        return [f"task={task}", f"scale={self.scale}", f"seed={seed}", *places, *self.overrides]

    def arms_of(self, seed: int) -> list[Arm]:
        """The arms that a seed has, an arm after that whose bonus it needs."""
        chosen = [arm for arm in self.arms if arm.seeds is None or seed in arm.seeds]
        return sorted(chosen, key=lambda arm: arm.bonus_of is not None)

    def declares(self, run: Place) -> bool:
        """Whether a run is of a declared seed, and an arm or the skills of one."""
        if run.task not in self.tasks or run.seed not in self.seeds_by_task.get(run.task, self.seeds):
            return False
        arms = self.arms_of(run.seed)
        systems = {arm.name for arm in arms} | {arm.skills_from for arm in arms if not arm.whole}
        return run.system in systems

    def steps(self, subtasks: int, seed: int, only: Container[str] | None = None) -> list[Step]:
        """What a seed's arms, or those named, need, each once: demonstrations, skills, then one arm after another."""
        arms = [arm for arm in self.arms_of(seed) if only is None or arm.name in only]
        sharing = [arm for arm in arms if arm.owner is None and not arm.whole]
        made = self.demonstrations_dir or f"demonstrations/{self.name}"
        steps: list[Step] = [("make_demonstrations", "whole=true")] if any(arm.whole for arm in arms) else []
        for one in (f"subtask={index}" for index in range(subtasks)):
            steps += [("make_demonstrations", one)] if sharing else []
            if any(arm.skills == SKILLS for arm in sharing):
                steps += [(SKILLS, one), ("evaluate", f"system={SKILLS}", one, "video=false")]
        owners = {arm.owner for arm in arms}
        for arm in self.arms:
            steps += arm.own_skills(subtasks, made) if arm.name in owners else []
        of_skills = {arm.name: arm.skill_settings for arm in self.arms}
        trained = (arm.steps(subtasks, made, of_skills.get(arm.owner or "", ())) for arm in arms)
        return [*steps, *(step for each in trained for step in each)]

    def steps_by_commit(
        self, subtasks: int, seed: int, only: Sequence[str] | None = None
    ) -> list[tuple[str | None, Step]]:
        """`steps`, each with the commit whose code runs it.

        What arms of two commits share stands there for both, and is made by the first.
        """
        arms = [arm for arm in self.arms_of(seed) if only is None or arm.name in only]
        steps = (
            (arm.commit or self.commit, step)
            for arm in arms
            for step in self.steps(subtasks, seed, [arm.name])
        )
        return list(dict.fromkeys(steps))  # each once, an arm still after that whose bonus it needs

    def unpublished(self, published: str | Path, task: str, seed: int) -> list[str]:
        """The arms of a seed that have no evaluation below `published`, the experiment's folder there."""
        return [
            arm.name
            for arm in self.arms_of(seed)
            if not (run_path(published, task, arm.name, seed) / "evaluation.csv").is_file()
        ]

    def check_arms(self, names: Iterable[str]) -> None:
        """Raises InvalidValueError for a name that no arm has."""
        known = [arm.name for arm in self.arms]
        unknown = [name for name in names if name not in known]
        if unknown:
            raise InvalidValueError(f"arms of {self.name} are {', '.join(known)}; got {', '.join(unknown)}")
