"""Which steps of a pipeline are done: what every recipe that starts recipes asks before it starts one.

A step is a recipe and its values. Its own config says where its results lie, so that nothing is guessed from its words.
"""

import re
from collections.abc import Container, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

from hydra import compose
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.check import ConfigError
from tstar_rl.config.demonstrations import check_made, demonstrated, demonstrations_path
from tstar_rl.config.load import ONE_POLICY
from tstar_rl.config.load import check_config as check_values
from tstar_rl.config.ranges import chain_length
from tstar_rl.config.values import plain
from tstar_rl.launch.side_by_side import Step
from tstar_rl.runs.csv_tables import read_table
from tstar_rl.runs.mismatch import (
    CHAINING,
    MACHINE_ONLY,
    NOT_CLONED,
    CheckpointMismatchError,
    as_begun,
    check_config,
    differences,
)
from tstar_rl.runs.run_config import read_config
from tstar_rl.runs.run_folder import FINISHED, is_untrained, run_path

__all__ = [
    "check_chain",
    "check_evaluation",
    "check_step",
    "chosen_scale",
    "ended_since",
    "evaluated_runs",
    "is_done",
    "missing",
    "passed_on",
    "run_folder",
    "step_config",
    "step_files",
]


UNTRAINING = ("make_demonstrations", "evaluate")
"""Steps that train nothing."""


def passed_on(own: Container[str]) -> list[str]:
    """The values on this recipe's command line that the recipes which it starts are given too.

    Args:
        own: keys and sections that only this recipe knows; values of these are left out, and launch, for the recipes
            that are started start none.
    """
    given = HydraConfig.get().overrides.task
    sections = [re.split(r"[.=]", value.lstrip("+~"), maxsplit=1)[0] for value in given]
    return [
        value
        for section, value in zip(sections, given, strict=True)
        if section not in own and section != "launch"
    ]


def chosen_scale() -> str:
    """The scale that this recipe's command line has chosen, or its config's default."""
    return HydraConfig.get().runtime.choices["scale"]


def step_config(step: Step, shared: Sequence[str] = ()) -> DictConfig:
    """The config that a step would run with; needs Hydra's configs, which a recipe has.

    Args:
        step: recipe and values.
        shared: values that come before the step's own, as in `run_recipe`.
    """
    name, *values = step
    return compose(f"recipe/{name}", [*shared, *values])


def check_step(step: Step, shared: Sequence[str] = ()) -> None:
    """Refuses now what a step's recipe would refuse of its values once it is run, hours later.

    Args:
        step: recipe and values.
        shared: values that come before the step's own.

    Raises:
        ConfigError: with the recipe and its values.
    """
    name, *values = step
    try:
        check_values(step_config(step, shared), name)
    except InvalidValueError as error:
        raise ConfigError(f"{' '.join((name, *values))}: {error}") from None


def is_done(step: Step, shared: Sequence[str] = (), ignored: Sequence[str] = ()) -> bool:
    """Whether a step need not be run: its files are there, and are what the step would make.

    Demonstrations are done if their files are there, and hold what the step would make. A training is done if it has
    finished with the same config and its results are there. One that may go on to more steps (`as_begun`) is not done
    if more are asked for than it was given. Whether its demonstrations or skills were made again since is not asked:
    with one config and one commit they are the same to the bit. An evaluation is done if every run that it
    evaluates has finished before it, and its table has each checkpoint that these have left, in all modes, with the
    number of episodes that is asked for. With resume=false nothing is done.

    Args:
        step: recipe and values.
        shared: values that come before the step's own.
        ignored: sections of a training's config that may have changed since it finished.

    Raises:
        CheckpointMismatchError: if a training has finished with another config, or an evaluation that is there is of
            another world or other skills.
        DemonstrationError: if demonstrations are of other settings, another number of episodes or another noise.
    """
    config = step_config(step, shared)
    if not config.resume or not all(file.is_file() for file in step_files(step, config)):
        return False
    if step[0] == "make_demonstrations":
        for part, kind in product(demonstrated(config), config.kinds):
            check_made(config, part, kind)
        return True
    if step[0] == "evaluate":
        return _is_evaluated(config)
    results = run_folder(config, "results_dir")
    saved = read_config(results)
    unread = NOT_CLONED if step[0] == "bc" else CHAINING if step[0] in ONE_POLICY else ()
    ignored = (*MACHINE_ONLY, *ignored, *unread)
    asked = {name: value for name, value in plain(config).items() if name not in ignored}
    begun = as_begun(saved, asked)
    check_config(results, saved, begun)
    return bool(saved) and begun == asked


def missing(steps: Sequence[Step], shared: Sequence[str] = (), ignored: Sequence[str] = ()) -> list[Step]:
    """Those of the steps, in their order, that are not done; takes and raises what `is_done` does.

    Where a training goes on to more steps, so does an evaluation of it that is done.
    """
    left: list[Step] = []
    trained: set[Path] = set()
    for step in steps:
        outdated = (
            bool(trained)
            and step[0] == "evaluate"
            and not trained.isdisjoint(evaluated_runs(step_config(step, shared)))
        )
        if outdated or not is_done(step, shared, ignored):
            left.append(step)
            if step[0] not in UNTRAINING:
                trained.add(run_folder(step_config(step, shared), "runs_dir"))
    return left


def step_files(step: Step, config: DictConfig) -> list[Path]:
    """What is there once a step is done.

    Args:
        step: recipe and values.
        config: the step's own.
    """
    if step[0] == "make_demonstrations":
        return [demonstrations_path(config, *each) for each in product(demonstrated(config), config.kinds)]
    if step[0] == "evaluate":
        return [run_folder(config, "results_dir") / "evaluation.csv"]
    return [run_folder(config, "runs_dir") / FINISHED]


def run_folder(config: DictConfig, root: str) -> Path:
    """Where a config's run lies below config.results_dir or config.runs_dir, whichever `root` names."""
    return run_path(config[root], config.task.name, config.system, config.seed, config.subtask)


def evaluated_runs(config: DictConfig) -> list[Path]:
    """Folders below config.runs_dir of the runs that an evaluation of config.system evaluates.

    That is one run; without fine-tuning it is the run of each skill of the chain.

    Raises:
        InvalidValueError: if one subtask of skills that are chained is asked for.
    """
    if is_untrained(config.system) and config.subtask is not None:
        raise InvalidValueError(
            f"system={config.system} is a chain, and has no subtask={config.subtask}: system={config.skills} "
            f"subtask={config.subtask} is the skill, chain.links takes the first skills of a chain"
        )
    if not is_untrained(config.system):
        return [run_folder(config, "runs_dir")]
    skills = (config.runs_dir, config.task.name, config.skills, config.seed)
    return [run_path(*skills, index) for index in range(chain_length(config))]


def check_evaluation(folder: Path, config: Mapping[str, Any]) -> None:
    """Refuses an evaluation that the config.yaml of `folder` would not tell of.

    That is one in another world than that of the training, or of the evaluation, that is there; and one of other skills
    chained as they are.

    Raises:
        CheckpointMismatchError: with what differs.
    """
    saved = read_config(folder)
    if not saved:
        return
    names = ("env", "skills", "links") if saved.get("evaluation_only") else ("env",)
    there, now = ({**values, "links": values.get("chain", {}).get("links")} for values in (saved, config))
    if wrong := differences(*({name: values.get(name) for name in names} for values in (there, now))):
        raise CheckpointMismatchError(
            f"{folder} has the results of something else: {'; '.join(wrong)}. Give the scale that it has, or another "
            "results_dir=..., or, of skills chained as they are, another system=no_finetuning_<name>"
        )


def check_chain(config: DictConfig, system: str) -> None:
    """Refuses a config of another world than that in which the chain of `system` was trained or evaluated.

    Raises:
        CheckpointMismatchError: with what differs.
    """
    folder = run_path(config.results_dir, config.task.name, system, config.seed)
    check_evaluation(folder, plain(config))


def begun_with(results: Path, config: DictConfig) -> tuple[str, str]:
    """The system whose skills a chain began with, and their checkpoint: as its training noted in `results`.

    Without fine-tuning, or where nothing is noted, they are those that are asked for.
    """
    found = {"skills": config.skills, "from_checkpoint": config.get("from_checkpoint", "last")}
    noted = read_config(results)
    if not noted.get("evaluation_only"):
        found |= {name: noted[name] for name in found if name in noted}
    return found["skills"], found["from_checkpoint"]


def ended_since(table: Path, runs: Sequence[Path]) -> bool:
    """Whether one of these runs has ended after a table that is there was written: it is of an earlier training."""
    ends = [run / FINISHED for run in runs]
    return any(end.is_file() and end.stat().st_mtime_ns > table.stat().st_mtime_ns for end in ends)


def _is_evaluated(config: DictConfig) -> bool:
    """Whether a table that is there is complete, and not older than the end of any run that it is of."""
    results, runs = run_folder(config, "results_dir"), evaluated_runs(config)
    check_evaluation(results, plain(config))
    file = results / "evaluation.csv"
    if not all((run / FINISHED).is_file() for run in runs) or ended_since(file, runs):
        return False
    table, evaluation = read_table(file), config.evaluation
    number = evaluation.whole_episodes if config.subtask is None else evaluation.episodes
    rows = table[(table.seed == config.seed) & (table.episodes == number)]
    rows, asked = rows[rows.checkpoint.isin(list(config.checkpoints))], set(config.modes)
    left = [name for name in config.checkpoints if all((run / name).is_dir() for run in runs)]
    return asked <= set(rows["mode"]) and all(
        asked <= set(rows[rows.checkpoint == name]["mode"]) for name in left
    )
