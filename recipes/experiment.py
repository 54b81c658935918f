"""A declared experiment: whatever is missing of it, some seeds at a time, for as long as it takes or is allowed.

    python recipes/experiment.py experiment=terminal_state_regularisation
    python recipes/experiment.py experiment=terminal_state_regularisation unpublished=true minutes=150

configs/experiment/<name>.yaml has the experiment; the page that it names declares it. A call that ends early, or is
killed, goes on when it is given again: what is finished is not done again, and a training goes on from its
checkpoint. It ends with 75 if the time was over while there is more to do. All arms come from one commit: where the
file names it (`commit`, also of a single arm), its code is checked out below <runs_dir>/code and run from there, so
that a later checkout goes on with an experiment and changes nothing of it. Tables land in results/<name>/; with
publish=true those of declared seeds and arms that this call has evaluated, or has found done as they are declared, are
copied to results/published/<name>/. With unpublished=true an arm of a seed that lies there is left out; of the rest,
what it starts from is made anew, which gives the same numbers, to the bit: tables that lie there stay, and other
numbers are an error.
"""

import itertools
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from threading import Lock
from typing import Any

from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig

from tstar_rl.checks import InvalidValueError, UserError
from tstar_rl.config.load import recipe
from tstar_rl.config.overrides import section_of
from tstar_rl.config.values import CONFIGS, plain
from tstar_rl.experiments.declared import DeclaredExperiment
from tstar_rl.experiments.published import publish
from tstar_rl.experiments.values import parse_experiment
from tstar_rl.launch.backends import check_local
from tstar_rl.launch.bonus import bonus_source, with_bonus, with_some_bonus, without_bonus
from tstar_rl.launch.code_of_commit import code_of_commit, configs_of
from tstar_rl.launch.overrides import passed_on
from tstar_rl.launch.side_by_side import Step, run_side_by_side
from tstar_rl.launch.steps import check_step, is_done, left_behind, step_config
from tstar_rl.launch.time_limit import MORE, TimeIsOver, check_goes_on, deadline, run_until
from tstar_rl.runs.mismatch import MACHINE_ONLY
from tstar_rl.runs.run_folder import Place

OWN = ("experiment", "processes", "minutes", "publish", "unpublished", "seeds", "tasks", "arms")

PUBLISHED = Path("results/published")

Planned = tuple[str | None, Step]
"""A step, and the commit whose code runs it; None: the code here."""


@recipe(
    "experiment", experiment=dict[str, Any] | None, processes=int, minutes=float | None, publish=bool,
    unpublished=bool, seeds=tuple[int, ...] | None, tasks=tuple[str, ...] | None, arms=tuple[str, ...] | None,
)  # fmt: skip
def main(config: DictConfig) -> None:
    """Runs a lane for each task and seed; a lane that waits for a bonus finds it when it gets there."""
    declared, end = _declared(config), deadline(config.minutes)
    published = PUBLISHED / declared.name
    lanes = _lanes(config, declared, published)
    named = {commit for lane in lanes for commit, _ in lane if commit is not None}
    code = {commit: code_of_commit(commit, Path(config.runs_dir) / "code") for commit in sorted(named)}
    run, stopped = _Steps(code, end, published), None
    _check(lanes, code)
    _check_bonuses(lanes, code, published)
    try:
        run_side_by_side(lanes, (), config.processes, run)
    except SystemExit as stop:
        stopped = stop  # what the other lanes have finished is published all the same
    if config.publish:
        first = [*declared.shared(*declared.lanes()[0]), *passed_on(OWN)]
        results = step_config(("gail_ppo",), first).results_dir
        try:
            written = publish(
                results, published, lambda place: declared.declares(place) and place in run.evaluated
            )
            print("\n".join(map(str, written)))
        except UserError as error:
            if stopped is None:
                raise
            stopped = SystemExit(f"{stopped}\n{error}")  # none of the two messages is lost
    if stopped is not None:
        _end(stopped, config.minutes, run.further)


def _declared(config: DictConfig) -> DeclaredExperiment:
    """The experiment that is asked for.

    Raises:
        InvalidValueError: if none is, or the values beside it do not go with an experiment.
    """
    if config.get("experiment") is None:
        names = sorted(file.stem for file in (CONFIGS / "experiment").glob("*.yaml"))
        raise InvalidValueError(f"say which: experiment=<name>; there are {', '.join(names)}")
    check_local(config.launch, "experiment.py")
    if one := [value for value in passed_on(OWN) if section_of(value) in ("seed", "task")]:
        raise InvalidValueError(
            f"every lane has a seed and a task of its own: seeds=[...] tasks=[...], not {one[0]}"
        )
    changes_nothing = set(MACHINE_ONLY) - {"evaluation"}
    other = [value for value in passed_on(OWN) if section_of(value) not in changes_nothing]
    chosen = [value for value in passed_on(set(OWN) - {"experiment"}) if section_of(value) == "experiment"]
    other += [value for value in chosen if not value.lstrip("+").startswith("experiment=")]
    if config.publish and other:
        raise InvalidValueError(
            f"publish=true publishes the experiment as it is declared, not with {other[0]}: publish=false tries that"
        )
    if config.minutes is not None:
        check_goes_on(config.resume, "experiment.py")
    declared = parse_experiment(plain(config)["experiment"])
    if declared.name != (file := HydraConfig.get().runtime.choices["experiment"]):
        raise InvalidValueError(
            f"experiment.name in {file}.yaml must be {file}, got {declared.name}: its runs and tables would be mixed "
            "with that one's"
        )
    declared.check_arms(config.arms or ())
    if config.unpublished and not PUBLISHED.is_dir():
        raise InvalidValueError(
            f"unpublished=true leaves out what lies below {PUBLISHED}, which is not there: start it in the clone's "
            "folder"
        )
    return declared


@dataclass
class _Steps:
    """Runs the steps of lanes, unless they are done.

    Attributes:
        code: of each commit, the folder of its code.
        end: when the time is over, in seconds of the monotonic clock.
        published: tables of the experiment, where a bonus may be found.
        further: steps that left more to go on from than they found.
        evaluated: whose evaluation is done.
    """

    code: dict[str, Path]
    end: float
    published: Path
    further: list[Step] = field(default_factory=list)
    evaluated: set[Place] = field(default_factory=set)
    composing: Lock = field(default_factory=Lock)
    """Hydra composes one config at a time."""

    def __call__(self, planned: Planned, shared: list[str], line: int) -> None:
        root, step = self.code.get(planned[0] or ""), planned[1]
        with self.composing, nullcontext() if root is None else configs_of(root):
            place = step_config(without_bonus(step))
            folders = place.results_dir, place.runs_dir, self.published
            step = with_bonus(step, place.task.name, place.seed, *folders)
            done = is_done(step, other_code=root is not None)
        if not done:
            self._run(step, place, line, root)
        if step[0] == "evaluate":
            self.evaluated.add(Place(place.task.name, place.system, place.seed, place.subtask))

    def _run(self, step: Step, place: DictConfig, line: int, root: Path | None) -> None:
        """Runs a step; `place` is its config."""
        before = left_behind(step, place)
        try:
            run_until(self.end, step, line=line, code=root)
        finally:
            self.further.extend([step] if left_behind(step, place) != before else [])


def _end(stopped: SystemExit, minutes: float, further: list[Step]) -> None:
    """Ends with what stopped the lanes: another exit code where it was the time, if there is more to go on from."""
    if set(str(stopped).splitlines()) != {str(TimeIsOver())}:
        raise stopped
    if not further:
        raise SystemExit(
            f"no step of the experiment has left anything to go on from after minutes={minutes:g}: give it more"
        )
    print("The time is over; the same command goes on.")
    raise SystemExit(MORE)


def _check(lanes: list[list[Planned]], code: dict[str, Path]) -> None:
    """Tells a mistake in an arm before any is trained; of steps that differ in their seed alone, one is looked at."""
    kinds = {
        (commit, *(value for value in step[1:] if not value.startswith("seed=")), step[0]): (commit, step)
        for commit, step in reversed(list(itertools.chain(*lanes)))
    }
    for commit, step in kinds.values():
        check_step(with_some_bonus(step), code=code.get(commit or ""))


def _check_bonuses(lanes: list[list[Planned]], code: dict[str, Path], published: Path) -> None:
    """Raises MissingFileError where the arm that decides another's bonus is neither there nor to be trained."""
    for lane in lanes:
        trained = {value for _, step in lane for value in step if value.startswith("system=")}
        for commit, step in lane:
            source = bonus_source(step)
            if source is None or f"system={source}" in trained:
                continue
            with nullcontext() if commit is None else configs_of(code[commit]):
                place = step_config(without_bonus(step))
            with_bonus(step, place.task.name, place.seed, place.results_dir, place.runs_dir, published)


def _lanes(config: DictConfig, declared: DeclaredExperiment, published: Path) -> list[list[Planned]]:
    """What there is to do of each task and seed."""
    lanes, given = [], passed_on(OWN)
    for task, seed in declared.lanes(config.seeds or (), config.tasks or ()):
        shared, arms = [*declared.shared(task, seed), *given], config.arms
        if config.unpublished:
            left = declared.unpublished(published, task, seed)
            arms = [name for name in left if arms is None or name in arms]
        place = step_config(("gail_ppo",), shared)
        there = replace(declared, demonstrations_dir=place.demonstrations_dir)
        steps = there.steps_by_commit(place.task.subtasks, seed, arms)
        lanes.append([(commit, (step[0], *shared, *step[1:])) for commit, step in steps])
    if not config.unpublished and not any(lanes):
        arms = "any arm" if config.arms is None else f"an arm of arms=[{', '.join(config.arms)}]"
        seeds = ", ".join(map(str, config.seeds or declared.every_seed))
        raise InvalidValueError(f"none of these seeds has {arms}: {seeds}")
    return lanes


if __name__ == "__main__":
    main()
