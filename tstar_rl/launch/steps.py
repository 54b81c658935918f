"""Which steps of a pipeline are done: what every recipe that starts recipes asks before it starts one.

A step is a recipe and its values. Its own config says where its results lie, so that nothing is guessed from its words.
"""

from collections.abc import Sequence
from contextlib import nullcontext
from functools import partial
from itertools import product
from pathlib import Path

from hydra import compose
from hydra.errors import HydraException
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

from tstar_rl.checks import InvalidValueError
from tstar_rl.config.check import ConfigError
from tstar_rl.config.demonstrations import check_made, demonstrated, demonstrations_path, digests_of_file
from tstar_rl.config.load import check_config as check_values
from tstar_rl.config.mistakes import in_words
from tstar_rl.config.recipe_kinds import ONE_POLICY
from tstar_rl.config.values import CONFIGS, plain
from tstar_rl.launch.code_of_commit import configs_of
from tstar_rl.launch.evaluations import is_evaluated
from tstar_rl.launch.run_folders import evaluated_runs, run_folder
from tstar_rl.launch.side_by_side import Step
from tstar_rl.runs.mismatch import (
    CHAINING,
    DEMONSTRATIONS_READ,
    FURNITURE,
    MACHINE_ONLY,
    NOT_CLONED,
    as_begun,
    check_config,
    known_then,
)
from tstar_rl.runs.run_config import read_config
from tstar_rl.runs.run_folder import FINISHED

__all__ = ["check_step", "is_done", "left_behind", "missing", "step_config", "step_files"]


UNTRAINING = ("make_demonstrations", "evaluate")
"""Steps that train nothing."""


def step_config(step: Step, shared: Sequence[str] = ()) -> DictConfig:
    """The config that a step would run with; needs Hydra's configs, which a recipe has.

    Args:
        step: recipe and values.
        shared: values that come before the step's own, as in `run_recipe`.
    """
    name, *values = step
    return compose(f"recipe/{name}", [*shared, *values])


def check_step(step: Step, shared: Sequence[str] = (), code: Path | None = None) -> None:
    """Refuses now what a step's recipe would refuse of its values once it is run, hours later.

    Args:
        step: recipe and values.
        shared: values that come before the step's own.
        code: the folder of another commit's, which runs the step: there are such values in its configs, or not; what
            it refuses of those that are there is not known here. None: the code here.

    Raises:
        ConfigError: with the recipe and its values.
    """
    name, *values = step
    check = partial(check_values, name=name) if code is None else None
    with nullcontext() if code is None else configs_of(code):
        try:
            config = step_config(step, shared)
            if check is not None:
                check(config)
            return
        except InvalidValueError as error:
            wrong = str(error)
        except (HydraException, OmegaConfBaseException) as error:
            configs = CONFIGS if code is None else code / "configs"
            wrong = in_words(error, configs, name, check, [*shared, *values])
    raise ConfigError(f"{' '.join((name, *values))}: {wrong}")


def is_done(
    step: Step, shared: Sequence[str] = (), ignored: Sequence[str] = (), other_code: bool = False
) -> bool:
    """Whether a step need not be run: its files are there, and are what the step would make.

    Demonstrations are done if their files are there, and hold what the step would make. A training is done if it has
    finished with the same config, which has the SHA-256 of a user's file of demonstrations, and its results and what it
    has trained are there.
    One that may go on to more steps (`as_begun`) is not done if more are asked for than it was given. Whether the
    library's demonstrations or its skills were made again since is not asked:
    with one config and one commit they are the same to the bit. An evaluation is done if every run that it
    evaluates has finished before it, and its table has each checkpoint that these have left, in all modes, with the
    number of episodes that is asked for. With resume=false nothing is done.

    Args:
        step: recipe and values.
        shared: values that come before the step's own.
        ignored: sections of a training's config that may have changed since it finished.
        other_code: whether the step is run with the code of another commit, which has furniture of its own.

    Raises:
        CheckpointMismatchError: if a training has finished with another config, or an evaluation that is there is of
            another world or other skills.
        DemonstrationError: if demonstrations are of other settings, another number of episodes or another noise.
    """
    config = step_config(step, shared)
    if not config.resume or not all(file.is_file() for file in step_files(step, config)):
        return False
    from tstar_rl.env.task_tables import furniture_digest  # with torch, which checks of values do without

    furniture = {} if other_code else {FURNITURE: furniture_digest(config.task.name)}
    if step[0] == "make_demonstrations":
        for part, kind in product(demonstrated(config), config.kinds):
            check_made(config, part, kind, furniture=not other_code)
        return True
    if step[0] == "evaluate":
        return is_evaluated(config, furniture)
    results = run_folder(config, "results_dir")
    saved = read_config(results)
    unread = NOT_CLONED if step[0] == "bc" else CHAINING if step[0] in ONE_POLICY else ()
    ignored = (*MACHINE_ONLY, *ignored, *unread)
    asked = {name: value for name, value in plain(config).items() if name not in ignored}
    if config.demonstrations.get("file") and (read := saved.get(DEMONSTRATIONS_READ)):
        asked[DEMONSTRATIONS_READ] = read | digests_of_file(config, read)
    asked = known_then(saved, asked | {"recipe": step[0]} | furniture)
    begun = as_begun(saved, asked)
    check_config(results, saved, begun)
    return bool(saved) and begun == asked and (run_folder(config, "runs_dir") / "last").is_dir()


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


def left_behind(step: Step, config: DictConfig) -> dict[Path, int]:
    """What a step that is stopped now leaves to go on from: checkpoints, and files that it has completed; when written.

    Args:
        step: recipe and values.
        config: the step's own.
    """
    checkpoints = (run_folder(config, "runs_dir") / "checkpoints").glob("checkpoint-*")
    files = (file for file in step_files(step, config) if file.is_file())
    return {path: path.stat().st_mtime_ns for path in (*checkpoints, *files)}
